//! Recorded clouds, real and made, against what is known of them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use lidar::Return;
use messages::{Refusal, Sweep};
use replay::{Fault, Format, Options, open};
use support::{all, assert_true, data, opened, sensors};

const NUSCENES: &str = "nuscenes/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";

fn one(path: &Path) -> Box<Sweep> {
    let mut sweeps = all(&mut opened(path).unwrap());
    assert_eq!(sweeps.len(), 1);
    let sweep = sweeps.remove(0);
    assert_true(&sweep);
    sweep
}

// verifies RPL-004
#[test]
fn the_nuscenes_sweep_has_its_counts_and_time_and_is_not_called_organised() {
    let Some(path) = data(NUSCENES) else { return };
    let sweep = one(&path);
    assert_eq!(sweep.header.recorded, 34_688);
    assert_eq!(sweep.header.refused[Refusal::TooNear as usize], 8_029);
    assert_eq!(sweep.returns.len(), 34_688 - 8_029);
    assert_eq!(sweep.header.sensor_time_ns, 1_532_402_927_647_951_000);
    assert_eq!(sweep.header.period_ns, 1_084 * 46_080);
    // Corrected for the car's motion: returns lie up to 5 degrees off their ring's elevation.
    assert!(!sweep.header.is_organised());
    let first = sweep.returns[0];
    let expected = [-3.12437, -0.43415, -1.86719];
    assert!(first.position().iter().zip(expected).all(|(found, known): (&f32, f32)| (found - known).abs() < 1e-5));
    assert_eq!(first.intensity, 4);
}

// verifies RPL-004, RPL-007
#[test]
fn the_nuscenes_limit_can_be_taken_away() {
    let Some(path) = data(NUSCENES) else { return };
    let options = Options { min_range_m: Some(0.0), ..Options::default() };
    let sweeps = all(&mut open(&path, &options, &sensors).unwrap());
    assert_eq!(sweeps[0].returns.len(), 34_688);
}

// verifies RPL-003, RPL-005
#[test]
fn the_pcd_sweep_has_its_counts_and_its_sensors_rings_and_columns() {
    let Some(path) = data("clouds/fast_gicp_251370668.pcd") else { return };
    let sweep = one(&path);
    assert_eq!(sweep.header.recorded, 69_088);
    assert_eq!(sweep.header.refused[Refusal::AtOrigin as usize], 5_032);
    assert_eq!(sweep.returns.len(), 64_056);
    assert!(sweep.header.is_organised());
    assert_eq!(sweep.columns.len(), 2_159);
    assert!(sweep.columns.iter().all(|column| column.valid == 1));
    assert_eq!(sweep.header.period_ns, 2_159 * 46_080);
    assert!((f64::from(sweep.header.column_step_rad).to_degrees() - 359.8 / 2_158.0).abs() < 1e-4);
    let channels = support::hdl_32e().lasers().iter().map(|laser| laser.ring).collect::<Vec<_>>();
    for (place, found) in sweep.returns.iter().enumerate() {
        let index = sweep.index_of(place) as usize;
        assert_eq!((usize::from(found.column), found.ring), (index / 32, channels[index % 32]));
        let column = sweep.columns[usize::from(found.column)];
        let off = found.y.atan2(found.x) - column.azimuth_rad;
        assert!(off.abs() < 1e-4 || off.abs() > 6.0, "the file has one azimuth a column: {off}");
    }
}

/// The PCD file's points in other encodings.
fn write_pcd(path: &Path, points: &[[f32; 4]], encoding: &str) {
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n\
         WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {encoding}\n",
        n = points.len()
    )
    .into_bytes();
    match encoding {
        "ascii" => {
            for [x, y, z, i] in points {
                bytes.extend(format!("{x} {y} {z} {i}\n").bytes());
            }
        }
        "binary" => points.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes())),
        _ => {
            let columns: Vec<u8> =
                (0..4).flat_map(|axis| points.iter().flat_map(move |point| point[axis].to_le_bytes())).collect();
            // Literal runs only: valid, if not small.
            let packed: Vec<u8> =
                columns.chunks(32).flat_map(|run| [&[run.len() as u8 - 1][..], run].concat()).collect();
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend((columns.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
    }
    std::fs::write(path, bytes).unwrap();
}

/// A made turn of an HDL-32E: 32 firings in each of `columns` columns, all with one azimuth, some without a return.
fn made_turn(columns: usize) -> Vec<[f32; 4]> {
    let lasers = support::hdl_32e().lasers().to_vec();
    let firing = |index: usize| {
        let (column, laser) = (index / 32, lasers[index % 32]);
        if index % 7 == 3 {
            return [0.0; 4];
        }
        let azimuth_rad = -(column as f64) / columns as f64 * std::f64::consts::TAU;
        let range_m = 5.0 + (index % 13) as f64;
        let (sin_el, cos_el) = laser.elevation_rad.sin_cos();
        let (sin_az, cos_az) = azimuth_rad.sin_cos();
        [range_m * cos_el * cos_az, range_m * cos_el * sin_az, range_m * sin_el, (index % 256) as f64].map(|v| v as f32)
    };
    (0..32 * columns).map(firing).collect()
}

// verifies RPL-003
#[test]
fn all_three_encodings_of_a_pcd_give_the_same_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let points = made_turn(40);
    let sweeps = ["ascii", "binary", "binary_compressed"].map(|encoding| {
        let path = folder.path().join(encoding);
        write_pcd(&path, &points, encoding);
        one(&path)
    });
    assert!(sweeps[0].header.is_organised());
    assert_eq!(sweeps[0].columns.len(), 40);
    for sweep in &sweeps {
        assert_eq!(sweep.returns[..], sweeps[0].returns[..]);
        assert_eq!(sweep.recorded_index[..], sweeps[0].recorded_index[..]);
        assert_eq!(sweep.header, sweeps[0].header);
    }
}

// verifies RPL-005
#[test]
fn a_cloud_that_is_not_true_to_the_sensor_is_called_unorganised() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pcd");
    type Spoil = fn(&mut Vec<[f32; 4]>);
    let spoils: [(&str, Spoil); 6] = [
        ("one return off its ring", |points| points[100][2] += 0.2),
        ("one return off its column", |points| {
            let [x, y, z, i] = points[100];
            points[100] = [x - y, x + y, z * 2.0_f32.sqrt(), i];
        }),
        ("two columns exchanged", |points| {
            for laser in 0..32 {
                points.swap(32 * 10 + laser, 32 * 20 + laser);
            }
        }),
        ("more than a turn", |points| points.extend_from_within(..64)),
        ("ring by ring", |points| {
            let columns = points.len() / 32;
            *points = (0..points.len()).map(|i| points[i % columns * 32 + i / columns]).collect();
        }),
        ("sorted by x", |points| points.sort_by(|a, b| a[0].total_cmp(&b[0]))),
    ];
    for (name, spoil) in spoils {
        let mut points = made_turn(40);
        spoil(&mut points);
        write_pcd(&path, &points, "binary");
        let sweep = one(&path);
        assert!(!sweep.header.is_organised(), "{name}");
        assert_eq!(sweep.header.recorded as usize, points.len());
    }
}

// verifies RPL-005
#[test]
fn returns_without_ring_and_column_get_both_back_from_the_sensor_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let points = made_turn(500);
    // Firings without return left out, and columns 100 to 109 with them.
    let kept: Vec<usize> =
        (0..points.len()).filter(|&i| points[i] != [0.0; 4] && !(100..110).contains(&(i / 32))).collect();
    let rows: Vec<String> =
        kept.iter().map(|&i| format!("{},{},{}", points[i][0], points[i][1], points[i][2])).collect();
    std::fs::write(&path, format!("x,y,z\n{}\n", rows.join("\n"))).unwrap();
    let sweep = one(&path);
    assert!(sweep.header.is_organised());
    assert_eq!(sweep.columns.len(), 500);
    let channels = support::hdl_32e().lasers().iter().map(|laser| laser.ring).collect::<Vec<_>>();
    for (found, &index) in sweep.returns.iter().zip(&kept) {
        assert_eq!((usize::from(found.column), found.ring), (index / 32, channels[index % 32]));
    }
    for (index, column) in sweep.columns.iter().enumerate() {
        assert_eq!(column.valid == 0, (100..110).contains(&index), "what the file does not have is unknown");
        let azimuth_rad = -(index as f64) / 500.0 * std::f64::consts::TAU;
        let off = (f64::from(column.azimuth_rad) - azimuth_rad + 1.0).rem_euclid(std::f64::consts::TAU) - 1.0;
        assert!(off.abs() < 1e-5, "{index}: {off}");
    }
}

fn csv(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

// verifies RPL-006
#[test]
fn rows_that_cannot_be_read_are_counted_and_keep_their_numbers() {
    let text = "intensity,x,why,y,z\r\n1,1,?,2,3\r\nx,1,?,2,3\n3,1,?,2\n\n300,4,?,5,6\n5,nan,?,2,3\n6,inf,?,0,0\n7,7,?,8,9,10\n";
    let (_folder, path) = csv(text);
    let mut recording = opened(&path).unwrap();
    let sweep = all(&mut recording).remove(0);
    assert_true(&sweep);
    assert_eq!(sweep.header.recorded, 7);
    assert_eq!(sweep.header.refused[Refusal::NotFinite as usize], 4);
    assert_eq!(&sweep.recorded_index[..], &[0, 3, 6]);
    assert_eq!(sweep.returns.iter().map(|found| found.intensity).collect::<Vec<_>>(), [1, 255, 7]);
    let found: Vec<_> = recording.faults().found().collect();
    assert_eq!(found, [(Fault::BadRow, 2), (Fault::Intensity, 1), (Fault::UnknownColumn, 1)]);
}

// verifies RPL-006
#[test]
fn equal_azimuths_of_a_table_are_one_column_whatever_their_zero_and_sense() {
    let lasers = support::hdl_32e().lasers().to_vec();
    let mut text = "x,y,z,ring,azimuth_deg,time_ns\n".to_owned();
    for column in 0..40_u64 {
        for (laser, model) in lasers.iter().enumerate().filter(|(laser, _)| (laser + column as usize).is_multiple_of(3))
        {
            // The file counts columns, from 7, clockwise; the geometry is counter-clockwise from 100°.
            let azimuth_rad = (100.0 + 9.0 * (column as f64 + laser as f64 / 40.0)).to_radians();
            let (x, y) = (10.0 * azimuth_rad.cos(), 10.0 * azimuth_rad.sin());
            let z = 10.0 * model.elevation_rad.tan();
            let time_ns = 5_000_000 + 2_500_000 * column + u64::from(model.offset_ns);
            text += &format!("{x},{y},{z},{},{},{time_ns}\n", model.ring, 7 + column);
        }
    }
    let (_folder, path) = csv(&text);
    let sweep = one(&path);
    assert!(sweep.header.is_organised());
    assert_eq!(sweep.columns.len(), 40);
    assert_eq!(sweep.header.sensor_time_ns, 5_000_000);
    for (index, column) in sweep.columns.iter().enumerate() {
        assert_eq!(column.offset_ns as usize, 2_500_000 * index);
        let expected_deg = (100.0 + 9.0 * index as f64 + 180.0).rem_euclid(360.0) - 180.0;
        assert!((f64::from(column.azimuth_rad).to_degrees() - expected_deg).abs() < 0.05, "{index}");
    }
}

// verifies RPL-006
#[test]
fn a_folder_of_tables_is_one_sweep_a_file_in_name_order_with_rising_time() {
    let folder = tempfile::tempdir().unwrap();
    for (name, x) in [("b.csv", 2), ("a.csv", 1), ("c.csv", 3), (".hidden.csv", 9)] {
        std::fs::write(folder.path().join(name), format!("x,y,z\n{x},0,1\n{x},1,1\n")).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "none of ours").unwrap();
    let mut recording = opened(folder.path()).unwrap();
    assert_eq!((recording.format(), recording.sweeps(), recording.sensor_name()), (Format::Csv, Some(3), "hdl-32e"));
    let sweeps = all(&mut recording);
    assert_eq!(sweeps.iter().map(|sweep| sweep.returns[0].x).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    let times: Vec<u64> = sweeps.iter().map(|sweep| sweep.header.sensor_time_ns).collect();
    assert_eq!(times, [0, 100_000_000, 200_000_000]);
    assert_eq!(recording.faults().count(Fault::OtherFile), 1);
}

// verifies RPL-006
#[test]
fn times_across_files_give_the_period() {
    let folder = tempfile::tempdir().unwrap();
    for sweep in 0..3_u64 {
        let start_ns = 1_000_000_000 + sweep * 80_000_000;
        let text = format!("x,y,z,time_ns\n1,0,1,{}\n1,1,1,{start_ns}\n", start_ns + 20);
        std::fs::write(folder.path().join(format!("{sweep}.csv")), text).unwrap();
    }
    let sweeps = all(&mut opened(folder.path()).unwrap());
    assert!(sweeps.iter().all(|sweep| sweep.header.period_ns == 80_000_000));
    assert_eq!(sweeps[2].header.sensor_time_ns, 1_160_000_000);
}

// verifies RPL-005
#[test]
fn two_returns_of_a_firing_may_share_ring_and_column() {
    let mut text = "x,y,z,ring,azimuth_deg\n".to_owned();
    for column in 0..20 {
        let azimuth_rad = f64::from(column) * 0.01;
        for range_m in [4.0, 9.0] {
            text += &format!("{},{},0,23,{column}\n", range_m * azimuth_rad.cos(), range_m * azimuth_rad.sin());
        }
    }
    let (_folder, path) = csv(&text);
    let sweep = one(&path);
    assert!(sweep.header.is_organised());
    let pair: Vec<Return> = sweep.returns[..2].to_vec();
    assert_eq!((pair[0].column, pair[0].ring), (pair[1].column, pair[1].ring));
}

// verifies RPL-005
#[test]
fn columns_that_do_not_turn_are_no_columns() {
    let mut text = "x,y,z,ring,azimuth_deg\n5,0,0,23,0\n5,0.1,0,23,0\n".to_owned();
    for key in 1..20 {
        text += &format!("5,0,0,23,{key}\n");
    }
    let (_folder, path) = csv(&text);
    assert!(!one(&path).header.is_organised());
}

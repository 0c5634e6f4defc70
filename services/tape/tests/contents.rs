//! What a recording holds, read back with the mcap crate.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{
    PERIOD_NS, Read, UTC_NS, bytes, empty, give, give_many, made, of, read, sequences, settings, shipped, start,
};
use foxglove::messages::{Log, PointCloud, SceneUpdate};
use messages::{Clusters, Descriptors, Detections, Raw, Sweep, Trace, TrackTable};
use prost::Message;
use tape::{Event, Level, Tape, TapeFile, Topic};

/// Records sweeps and gives the messages and what was counted.
fn recorded(topics: &[Topic], sectors: u32, sweeps: u64) -> (Vec<Read>, tape::Counts) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(topics), &path, sectors);
    for number in 0..sweeps {
        give(&mut tape, &made(number), sectors);
    }
    tape.finish(UTC_NS).unwrap();
    (read(&path), tape.counts())
}

#[test]
fn sweeps_read_back_to_the_bit_in_any_number_of_sectors() {
    for sectors in [1, 3, 36] {
        let (read, _) = recorded(&[Topic::RawSweep], sectors, 5);
        assert_eq!(read.len(), 5);
        for (number, read) in read.iter().enumerate() {
            let made = made(number as u64);
            assert_eq!(read.data, bytes(&*made.sweep), "sweep {number} of {sectors} sectors");
            let mut again = empty::<Sweep>();
            again.read_raw(&read.data).unwrap();
            assert_eq!(again.returns[..], made.sweep.returns[..]);
        }
    }
}

#[test]
fn detections_read_back_to_the_bit_behind_the_trace_of_the_last_part() {
    for sectors in [1, 36] {
        let (read, _) = recorded(&[Topic::RawDetections], sectors, 3);
        for (number, read) in read.iter().enumerate() {
            let made = made(number as u64);
            let (trace, rest) = Trace::read_raw(&read.data).unwrap();
            assert_eq!(trace, made.trace(sectors - 1, sectors));
            let mut again = empty::<Detections>();
            again.read_raw(rest).unwrap();
            assert_eq!(again.detections[..], made.detections.detections[..]);
            assert_eq!(again.members[..], made.detections.members[..]);
            assert_eq!(again.solids[..], made.detections.solids[..]);
            assert_eq!(again.header.recorded, made.sweep.header.recorded);
        }
    }
}

#[test]
fn tracks_read_back_to_the_bit_behind_the_trace_of_the_last_part() {
    for sectors in [1, 36] {
        let (read, _) = recorded(&[Topic::RawTracks], sectors, 3);
        assert_eq!(read.len(), 3);
        for (number, read) in read.iter().enumerate() {
            let made = made(number as u64);
            let (trace, rest) = Trace::read_raw(&read.data).unwrap();
            assert_eq!((trace, rest), (made.trace(sectors - 1, sectors), &bytes(&*made.tracks)[..]));
            let mut again = empty::<TrackTable>();
            again.read_raw(rest).unwrap();
            assert_eq!(again.keys_of(&again.tracks[1]), made.tracks.keys_of(&made.tracks.tracks[1]));
        }
    }
}

#[test]
fn every_track_is_an_entity_of_its_sweeps_update() {
    let (read, _) = recorded(&[Topic::Tracks], 36, 2);
    for (number, read) in read.iter().enumerate() {
        let update = SceneUpdate::decode(&read.data[..]).unwrap();
        let ids: Vec<&str> = update.entities.iter().map(|entity| entity.id.as_str()).collect();
        assert_eq!(ids, ["track-1025", "track-1026", "track-1027"]);
        let end_ns = 5_000_000_000 + (number as u64 + 1) * PERIOD_NS;
        assert_eq!(update.entities[0].timestamp.unwrap().nsec(), (end_ns % 1_000_000_000) as u32);
    }
}

#[test]
fn a_message_has_sensor_time_host_time_and_the_sweeps_number() {
    let (read, _) = recorded(&shipped().topics, 3, 3);
    let of_sweeps = shipped().topics.into_iter().filter(|topic| !matches!(topic, Topic::Events | Topic::Status));
    for topic in of_sweeps {
        let read = of(&read, topic);
        assert_eq!(read.len(), 3, "{topic:?}");
        for (number, read) in read.iter().enumerate() {
            let number = number as u64;
            assert_eq!(u64::from(read.sequence), number);
            assert_eq!(read.log_time_ns, 5_000_000_000 + number * PERIOD_NS);
            assert_eq!(read.utc_ns, UTC_NS + number * PERIOD_NS);
        }
    }
}

#[test]
fn clusters_are_numbered_by_rank_of_key_and_every_return_has_its_own() {
    for sectors in [1, 36] {
        let (read, _) = recorded(&[Topic::Clusters], sectors, 1);
        let cloud = PointCloud::decode(&read[0].data[..]).unwrap();
        let made = made(0);
        assert_eq!(cloud.data.len(), 28 * made.sweep.returns.len());
        let columns = 6;
        for (point, echo) in cloud.data.chunks_exact(28).zip(&made.sweep.returns) {
            let cluster = i32::from_le_bytes(point[16..20].try_into().unwrap());
            assert_eq!(cluster, i32::from(echo.column / columns));
            let class = made.detections.detections[cluster as usize].class;
            assert_eq!((point[20..23].to_vec(), point[24]), (tape::colour(class).to_vec(), class as u8));
        }
    }
}

#[test]
fn every_obstacle_is_an_entity_of_its_sweeps_update() {
    let (read, _) = recorded(&[Topic::Detections, Topic::Sweep], 36, 2);
    for read in of(&read, Topic::Detections) {
        let update = SceneUpdate::decode(&read.data[..]).unwrap();
        assert_eq!(update.entities.len(), 20);
        assert!(update.entities.iter().all(|entity| entity.frame_id == "lidar"));
    }
    for read in of(&read, Topic::Sweep) {
        let cloud = PointCloud::decode(&read.data[..]).unwrap();
        assert_eq!(cloud.data.len(), 16 * made(0).sweep.returns.len());
    }
}

#[test]
fn counts_are_those_of_the_file() {
    let (read, counts) = recorded(&shipped().topics, 3, 4);
    assert_eq!(counts.topics.len(), shipped().topics.len());
    for topic in shipped().topics {
        let of_topic = counts.of(topic).unwrap();
        assert_eq!(of_topic.messages, of(&read, topic).len() as u64, "{topic:?}");
        assert_eq!((of_topic.lost, of_topic.removed), (0, 0));
    }
    assert_eq!((counts.files, counts.doubles, counts.failure), (1, 0, None));
}

#[test]
fn topics_that_were_not_asked_for_are_not_in_the_file() {
    for topic in Topic::ALL {
        let (read, counts) = recorded(&[topic], 2, 2);
        assert!(read.iter().all(|read| read.topic == topic.name()));
        assert_eq!(counts.topics.len(), 1);
    }
}

#[test]
fn every_channel_says_how_to_read_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&Topic::ALL), &path, 1);
    give(&mut tape, &made(0), 1);
    tape.finish(UTC_NS).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.channels.len(), Topic::ALL.len());
    for topic in Topic::ALL {
        let channel = summary.channels.values().find(|channel| channel.topic == topic.name()).unwrap();
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.name.as_str(), channel.message_encoding.as_str()),
            (topic.schema().name.as_str(), topic.message_encoding())
        );
        assert_eq!(schema.data, topic.schema().data);
    }
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    let said = |key: &str| metadata.metadata[key].as_str();
    assert_eq!(metadata.name, "encke.run");
    assert_eq!((said("version"), said("source"), said("sensor")), ("0.1.0", "scenes/x.toml", "hdl-32e"));
    assert_eq!((said("sectors"), said("pace"), said("instance"), said("part")), ("1", "fast", "i", "0"));
}

#[test]
fn events_and_status_wait_for_the_sensors_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::Events, Topic::Status]), &path, 1);
    let say = |tape: &mut Tape, message: &str| {
        tape.event(UTC_NS, &Event { level: Level::Info, name: "chain", word: "w", number: 0, message });
    };
    say(&mut tape, "started");
    tape.status(UTC_NS, br#"{"mode":"nominal"}"#);
    give(&mut tape, &made(7), 1);
    say(&mut tape, "stopped");
    tape.finish(UTC_NS).unwrap();
    let read = read(&path);
    assert!(read.iter().all(|read| read.log_time_ns == made(7).sweep.header.sensor_time_ns));
    let said = |read: &Read| Log::decode(&read.data[..]).unwrap().message;
    assert_eq!(of(&read, Topic::Events).iter().map(said).collect::<Vec<_>>(), ["started", "stopped"]);
    assert_eq!(of(&read, Topic::Status)[0].data, br#"{"mode":"nominal"}"#);
}

#[test]
fn events_of_a_run_without_a_sweep_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::Events]), &path, 1);
    tape.event(UTC_NS, &Event { level: Level::Fatal, name: "chain", word: "w", number: 0, message: "no source" });
    tape.finish(UTC_NS).unwrap();
    assert_eq!(read(&path).len(), 1);
}

#[test]
fn a_run_in_which_nothing_was_said_is_a_readable_file() {
    let (read, counts) = recorded(&[Topic::Events], 1, 0);
    assert_eq!((read.len(), counts.files), (0, 1));
}

#[test]
fn raw_parts_are_written_as_they_come() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::RawClusters, Topic::RawDescriptors]), &path, 2);
    let (mut clusters, mut descriptors) = (empty::<Clusters>(), empty::<Descriptors>());
    (clusters.header.period_ns, descriptors.header.period_ns) = (1, 2);
    clusters.members.push(8).unwrap();
    for sector in [0, 1, 1] {
        tape.clusters(UTC_NS, &made(0).trace(sector, 2), &clusters);
    }
    tape.descriptors(UTC_NS, &made(0).trace(1, 2), &descriptors);
    tape.finish(UTC_NS).unwrap();
    let read = read(&path);
    assert_eq!(sequences(&read, Topic::RawClusters), [0, 0]);
    let parts = of(&read, Topic::RawClusters);
    for (sector, part) in parts.iter().enumerate() {
        let (trace, rest) = Trace::read_raw(&part.data).unwrap();
        assert_eq!(trace, made(0).trace(sector as u32, 2));
        assert_eq!(rest, bytes(&*clusters));
    }
    let counts = tape.counts();
    assert_eq!((counts.doubles, counts.of(Topic::RawDescriptors).unwrap().lost), (1, 1));
}

#[test]
fn the_same_messages_at_the_same_times_are_the_same_bytes() {
    for compression in [tape::Compression::None, tape::Compression::Lz4, tape::Compression::Zstd] {
        let files = [(); 2].map(|()| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("run.mcap");
            let settings = TapeFile { compression, chunk_kib: 32, ..shipped() }.checked().unwrap();
            let mut tape = start(settings, &path, 1);
            give_many(&mut tape, 0..20);
            tape.finish(UTC_NS).unwrap();
            assert_eq!(read(&path).len(), 160);
            std::fs::read(path).unwrap()
        });
        assert!(files[0] == files[1]);
    }
}

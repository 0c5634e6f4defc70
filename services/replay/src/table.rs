//! Sweeps as a folder of tables, one file a sweep.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use messages::Sweep;

/// Writes sweeps as CSV files `sweep_000000.csv`, … that [`open`](crate::open) reads back.
///
/// Coordinates are written so that they read back to the bit. An organised sweep has the columns
/// `x,y,z,intensity,ring,azimuth_deg,time_ns`, where `azimuth_deg` is the column's azimuth, counter-clockwise from +x;
/// an unorganised one has `x,y,z,intensity`. Columns without any return are not written.
#[derive(Debug)]
pub struct TableWriter {
    folder: PathBuf,
    sweeps: u64,
}

impl TableWriter {
    /// Makes the folder if it does not exist.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn new(folder: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned(), sweeps: 0 })
    }

    /// Writes the accepted returns of a whole sweep to a file of its own; its path.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, sweep: &Sweep) -> io::Result<PathBuf> {
        let path = self.folder.join(format!("sweep_{:06}.csv", self.sweeps));
        let mut out = BufWriter::new(File::create(&path)?);
        let is_organised = sweep.header.is_organised();
        let rest = if is_organised { ",ring,azimuth_deg,time_ns" } else { "" };
        writeln!(out, "x,y,z,intensity{rest}")?;
        for found in &sweep.returns {
            write!(out, "{},{},{},{}", found.x, found.y, found.z, found.intensity)?;
            let column = sweep.columns.get(usize::from(found.column));
            let ring = sweep.rings.get(usize::from(found.ring));
            if let (true, Some(column), Some(ring)) = (is_organised, column, ring) {
                let time_ns = sweep.header.sensor_time_ns + u64::from(column.offset_ns) + u64::from(ring.offset_ns);
                write!(out, ",{},{},{time_ns}", found.ring, f64::from(column.azimuth_rad).to_degrees())?;
            }
            writeln!(out)?;
        }
        out.flush()?;
        self.sweeps += 1;
        Ok(path)
    }
}

//! Files that hold one cloud each.

use std::path::{Path, PathBuf};

use super::source::CloudSource;
use super::{Cloud, csv, kitti, nuscenes, pcd, ply};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::format::Format;

/// Clouds of a folder in name order, or of one file.
pub(crate) struct CloudFiles {
    files: Vec<PathBuf>,
    format: Format,
    /// Next file to read.
    file: usize,
    line: Vec<u8>,
    pcd: pcd::Memory,
    ply: ply::Memory,
}

impl CloudFiles {
    pub(crate) fn new(files: Vec<PathBuf>, format: Format) -> Self {
        Self { files, format, file: 0, line: Vec::new(), pcd: pcd::Memory::default(), ply: ply::Memory::default() }
    }
}

impl CloudSource for CloudFiles {
    fn read(&mut self, cloud: &mut Cloud, faults: &mut Faults) -> Option<Result<(), ReplayError>> {
        let path = self.files.get(self.file)?;
        self.file += 1;
        let read = match self.format {
            Format::Csv => csv::read(path, cloud, &mut self.line, faults),
            Format::Pcd => pcd::read(path, cloud, &mut self.pcd, faults),
            Format::Ply => ply::read(path, cloud, &mut self.ply, faults),
            Format::Kitti => kitti::read(path, cloud, faults),
            Format::NuScenes | Format::Pcap | Format::Mcap => nuscenes::read(path, cloud, faults),
        };
        if let Err(error) = &read
            && self.files.len() > 1
        {
            faults.note(Fault::BadFile, 1, path, Place::Byte(0), error);
        }
        Some(read)
    }

    fn rewind(&mut self) {
        self.file = 0;
    }

    fn count(&self) -> Option<u64> {
        Some(self.files.len() as u64)
    }

    fn place(&self) -> (&Path, Place) {
        let path = self.files.get(self.file.saturating_sub(1)).map_or(Path::new(""), PathBuf::as_path);
        (path, Place::Byte(0))
    }
}

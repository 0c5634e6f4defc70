use std::fmt;
use std::str::FromStr;

use crate::{capture, cloud, mcap};

/// A format of recorded data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Format {
    /// Velodyne data packets in a classic or next-generation capture.
    Pcap,
    /// Comma-separated values with a header line, one sweep a file.
    Csv,
    /// Point Cloud Data of PCL, one sweep a file.
    Pcd,
    /// nuScenes `LIDAR_TOP`: five floats a return, one sweep a file.
    NuScenes,
    /// Polygon file format, one sweep a file.
    Ply,
    /// KITTI: four floats a return, one sweep a file.
    Kitti,
    /// Messages of Encke and of others in one container.
    Mcap,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 7] = [Self::Pcap, Self::Csv, Self::Pcd, Self::NuScenes, Self::Ply, Self::Kitti, Self::Mcap];

    /// The format's word on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pcap => "pcap",
            Self::Csv => "csv",
            Self::Pcd => "pcd",
            Self::NuScenes => "nuscenes",
            Self::Ply => "ply",
            Self::Kitti => "kitti",
            Self::Mcap => "mcap",
        }
    }

    /// The format of a file that begins with `head`.
    pub(crate) fn of(head: &[u8]) -> Option<Self> {
        // Those with a mark of their own come first.
        if capture::is_capture(head) {
            Some(Self::Pcap)
        } else if mcap::is_mcap(head) {
            Some(Self::Mcap)
        } else if cloud::ply::is_ply(head) {
            Some(Self::Ply)
        } else if cloud::pcd::is_pcd(head) {
            Some(Self::Pcd)
        } else if cloud::csv::is_csv(head) {
            Some(Self::Csv)
        } else if cloud::nuscenes::is_nuscenes(head) {
            Some(Self::NuScenes)
        } else if cloud::kitti::is_kitti(head) {
            Some(Self::Kitti)
        } else {
            None
        }
    }

    /// The names of all, for a message.
    pub(crate) fn list() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// Name of the sensor model where the caller does not give one: KITTI's sensor is known, the others are taken for
    /// the HDL-32E.
    pub(crate) fn sensor(self) -> &'static str {
        if self == Self::Kitti { "hdl-64e" } else { "hdl-32e" }
    }

    /// Nearest range accepted where the caller does not say [m]: nuScenes keeps firings without a return, and returns
    /// from the car itself, within 1 m.
    pub(crate) fn near_m(self) -> Option<f64> {
        (self == Self::NuScenes).then_some(1.0)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The word names no format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("format is {word}, must be one of {list}", word = .0, list = Format::list())]
pub struct UnknownFormat(pub String);

impl FromStr for Format {
    type Err = UnknownFormat;

    fn from_str(word: &str) -> Result<Self, UnknownFormat> {
        Self::ALL.into_iter().find(|format| format.name() == word).ok_or_else(|| UnknownFormat(word.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_found_by_its_own_name() {
        for format in Format::ALL {
            assert_eq!(format.name().parse(), Ok(format));
        }
        assert!(
            "las".parse::<Format>().unwrap_err().to_string().contains("pcap, csv, pcd, nuscenes, ply, kitti, mcap")
        );
    }
}

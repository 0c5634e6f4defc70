//! Messages that are clouds.

use std::path::Path;

use super::foxglove::PointCloud;
use super::messages::Messages;
use super::pointcloud2;
use super::topics::Kind;
use crate::cloud::Cloud;
use crate::cloud::packed::LeftOut;
use crate::cloud::source::CloudSource;
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// The clouds of a topic.
pub(crate) struct MessageClouds {
    messages: Messages,
    foxglove: PointCloud,
}

impl MessageClouds {
    pub(crate) fn new(messages: Messages) -> Self {
        Self { messages, foxglove: PointCloud::default() }
    }
}

impl CloudSource for MessageClouds {
    fn read(&mut self, cloud: &mut Cloud, faults: &mut Faults) -> Option<Result<(), ReplayError>> {
        let kind = self.messages.kind();
        let message = self.messages.next(faults)?;
        let logged_ns = message.log_time_ns;
        let found = match kind {
            Kind::Foxglove => self
                .foxglove
                .read(message.data)
                .and_then(|()| self.foxglove.packed())
                .map(|packed| packed.unpack(logged_ns, cloud)),
            _ => pointcloud2::parse(message.data, kind == Kind::PointCloud2Ros1)
                .map(|packed| packed.unpack(logged_ns, cloud)),
        };
        let (path, place) = self.messages.place();
        Some(match found {
            Ok(LeftOut { missing, clamped }) => {
                if missing > 0 {
                    let what = format!("the message ends {missing} points before its cloud does");
                    faults.note(Fault::TornCloud, missing, path, place, what);
                }
                if clamped > 0 {
                    faults.note(Fault::Intensity, clamped, path, place, "an intensity outside 0 to 255");
                }
                Ok(())
            }
            Err(what) => {
                faults.note(Fault::BadMessage, 1, path, place, &what);
                Err(ReplayError::Malformed { path: path.to_owned(), place, what })
            }
        })
    }

    fn rewind(&mut self) {
        self.messages.rewind();
    }

    fn count(&self) -> Option<u64> {
        None
    }

    fn place(&self) -> (&Path, Place) {
        self.messages.place()
    }
}

//! Topics of a file, what they hold, and which of them is read.

use std::collections::BTreeMap;
use std::path::Path;

use ::mcap::records::op;
use messages::{Message, Sweep};

use crate::error::ReplayError;

/// Topics of Encke's own recordings: the whole sweep, and what people see of it.
const OWN_CLOUD: &str = "/encke/sweep";

/// What a topic's messages are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Encke's sweeps to the bit.
    Raw,
    /// `sensor_msgs/msg/PointCloud2` of ROS 2, in CDR.
    PointCloud2,
    /// `sensor_msgs/PointCloud2` of ROS 1.
    PointCloud2Ros1,
    /// `foxglove.PointCloud` in protobuf.
    Foxglove,
}

/// The kinds, for a message.
const KNOWN: &str = "sensor_msgs/msg/PointCloud2, foxglove.PointCloud";

impl Kind {
    fn of(encoding: &str, schema: &str) -> Option<Self> {
        match (encoding, schema) {
            ("encke", Sweep::TYPE) => Some(Self::Raw),
            ("cdr", "sensor_msgs/msg/PointCloud2" | "sensor_msgs/PointCloud2") => Some(Self::PointCloud2),
            ("ros1", "sensor_msgs/PointCloud2") => Some(Self::PointCloud2Ros1),
            ("protobuf", "foxglove.PointCloud") => Some(Self::Foxglove),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
struct Channel {
    topic: String,
    kind: Option<Kind>,
    /// Type and encoding, for a message.
    what: String,
}

/// Fields of a record. `mcap`'s own reading of them allocates whatever length a string claims.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn number(&mut self) -> Option<u16> {
        let (bytes, rest) = self.0.split_first_chunk::<2>()?;
        self.0 = rest;
        Some(u16::from_le_bytes(*bytes))
    }

    fn string(&mut self) -> Option<String> {
        let (length, rest) = self.0.split_first_chunk::<4>()?;
        let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        self.0 = rest;
        // Names are for people and for comparison.
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

/// Name of the metadata of Encke's own recordings, and the key under which the number of the file in its run stands.
const RUN: &str = "encke.run";
const PART: &str = "part";

/// Channels by their number, as a file introduces them.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    goes_on: bool,
}

impl Channels {
    /// Takes note of a schema or a channel; whether it was a channel. What cannot be read is none.
    pub(super) fn learn(&mut self, opcode: u8, data: &[u8]) -> bool {
        let mut fields = Fields(data);
        match opcode {
            op::SCHEMA => {
                if let Some((id, name)) = fields.number().zip(fields.string()) {
                    self.schemas.insert(id, name);
                }
                false
            }
            op::CHANNEL => self.learn_channel(fields).is_some(),
            op::METADATA => {
                self.learn_run(fields);
                false
            }
            _ => false,
        }
    }

    fn learn_channel(&mut self, mut fields: Fields<'_>) -> Option<()> {
        let (id, schema) = (fields.number()?, fields.number()?);
        let (topic, encoding) = (fields.string()?, fields.string()?);
        let schema = self.schemas.get(&schema).map_or("", String::as_str);
        let kind = Kind::of(&encoding, schema);
        let what = format!("{schema} in {encoding}");
        self.channels.insert(id, Channel { topic, kind, what });
        Some(())
    }

    /// What Encke's own recordings say of their run.
    fn learn_run(&mut self, mut fields: Fields<'_>) -> Option<()> {
        if fields.string()? != RUN {
            return None;
        }
        // The length of the map in bytes.
        let (_, rest) = fields.0.split_first_chunk::<4>()?;
        fields.0 = rest;
        loop {
            let (key, value) = (fields.string()?, fields.string()?);
            if key == PART {
                self.goes_on = value != "0";
            }
        }
    }

    /// Whether the file goes on with the run of one before it, whose last sweeps it may hold again.
    pub(super) fn goes_on(&self) -> bool {
        self.goes_on
    }

    /// Whether the messages of channel `id` are those of `choice`.
    pub(super) fn is(&self, id: u16, choice: &Choice) -> bool {
        self.channels.get(&id).is_some_and(|known| known.kind == Some(choice.kind) && known.topic == choice.topic)
    }

    /// Whether it is clear which topic is read, whatever else comes.
    pub(super) fn is_clear(&self, wanted: Option<&str>) -> bool {
        self.channels.values().any(|known| match wanted {
            Some(wanted) => known.topic == wanted,
            None => known.kind == Some(Kind::Raw),
        })
    }

    /// The topic to read: the one that is `wanted`, else Encke's own sweeps, else the only one that holds clouds.
    pub(super) fn choose(&self, path: &Path, wanted: Option<&str>) -> Result<Choice, ReplayError> {
        let topics: BTreeMap<&str, &Channel> =
            self.channels.values().map(|known| (known.topic.as_str(), known)).collect();
        let choice = |known: &Channel| known.kind.map(|kind| Choice { topic: known.topic.clone(), kind });
        let fails = |what: String| Err(ReplayError::Topic { path: path.to_owned(), what });
        let list = |only_known: bool| -> String {
            let named = topics.values().filter(|known| !only_known || known.kind.is_some());
            let named: Vec<String> = named.map(|known| format!("{} ({})", known.topic, known.what)).collect();
            if named.is_empty() { "none".to_owned() } else { named.join(", ") }
        };
        if let Some(wanted) = wanted {
            return match topics.get(wanted).map(|known| choice(known)) {
                Some(Some(choice)) => Ok(choice),
                Some(None) => {
                    fails(format!("topic {wanted} holds {}, must hold {}, {KNOWN}", topics[wanted].what, Sweep::TYPE))
                }
                None => fails(format!("has no topic {wanted}; give one of {} with --topic", list(true))),
            };
        }
        let of_kind =
            |kind: Kind| topics.values().find(|known| known.kind == Some(kind)).and_then(|known| choice(known));
        let own_cloud = || topics.get(OWN_CLOUD).and_then(|known| choice(known));
        if let Some(choice) = of_kind(Kind::Raw).or_else(own_cloud) {
            return Ok(choice);
        }
        let mut known = topics.values().filter_map(|known| choice(known));
        match (known.next(), known.next()) {
            (Some(choice), None) => Ok(choice),
            (Some(_), Some(_)) => {
                fails(format!("holds clouds in several topics; choose one with --topic: {}", list(true)))
            }
            (None, _) => {
                fails(format!("holds no sweeps; its topics are {}; must be {}, {KNOWN}", list(false), Sweep::TYPE))
            }
        }
    }
}

/// The topic that is read.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) topic: String,
    pub(super) kind: Kind,
}

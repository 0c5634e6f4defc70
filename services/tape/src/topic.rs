//! What a recording may hold: names, encodings and schemas.

use foxglove::messages::{Log, PointCloud, SceneUpdate};
use foxglove::{Encode, Schema};
use messages::{Clusters, Descriptors, Detections, Message, Sweep, TrackTable};
use serde::{Deserialize, Serialize};

use crate::schemas::{STATUS, TRUTH};

/// Number of topics.
pub(crate) const TOPICS: usize = Topic::ALL.len();

/// A channel of a recording, by its name below `/encke/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Topic {
    /// Accepted returns of a sweep, for people.
    #[serde(rename = "sweep")]
    Sweep,
    /// The same with cluster, class and colour.
    #[serde(rename = "clusters")]
    Clusters,
    /// Fitted solids, for people.
    #[serde(rename = "detections")]
    Detections,
    /// Obstacles through time, for people.
    #[serde(rename = "tracks")]
    Tracks,
    /// What the simulator knows.
    #[serde(rename = "truth")]
    Truth,
    /// What happened.
    #[serde(rename = "events")]
    Events,
    /// How the chain is.
    #[serde(rename = "status")]
    Status,
    /// The sweep without loss, for replay.
    #[serde(rename = "raw/sweep")]
    RawSweep,
    /// The clusters' parts as they came.
    #[serde(rename = "raw/clusters")]
    RawClusters,
    /// The descriptors' parts as they came.
    #[serde(rename = "raw/descriptors")]
    RawDescriptors,
    /// The detections of a sweep without loss.
    #[serde(rename = "raw/detections")]
    RawDetections,
    /// The tracks at the end of a sweep without loss.
    #[serde(rename = "raw/tracks")]
    RawTracks,
}

impl Topic {
    /// All topics, by their number.
    pub const ALL: [Self; 12] = [
        Self::Sweep,
        Self::Clusters,
        Self::Detections,
        Self::Tracks,
        Self::Truth,
        Self::Events,
        Self::Status,
        Self::RawSweep,
        Self::RawClusters,
        Self::RawDescriptors,
        Self::RawDetections,
        Self::RawTracks,
    ];

    /// The channel's name in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sweep => "/encke/sweep",
            Self::Clusters => "/encke/clusters",
            Self::Detections => "/encke/detections",
            Self::Tracks => "/encke/tracks",
            Self::Truth => "/encke/truth",
            Self::Events => "/encke/events",
            Self::Status => "/encke/status",
            Self::RawSweep => "/encke/raw/sweep",
            Self::RawClusters => "/encke/raw/clusters",
            Self::RawDescriptors => "/encke/raw/descriptors",
            Self::RawDetections => "/encke/raw/detections",
            Self::RawTracks => "/encke/raw/tracks",
        }
    }

    /// How the channel's messages are written: `protobuf`, `json`, or `encke` for [`messages::Raw`].
    pub const fn message_encoding(self) -> &'static str {
        match self {
            Self::Sweep | Self::Clusters | Self::Detections | Self::Tracks | Self::Events => "protobuf",
            Self::Truth | Self::Status => "json",
            Self::RawSweep | Self::RawClusters | Self::RawDescriptors | Self::RawDetections | Self::RawTracks => {
                "encke"
            }
        }
    }

    /// What the channel's messages are: Foxglove's own schemas, a JSON schema, or the name of a [`Message::TYPE`].
    pub fn schema(self) -> Schema {
        let raw = |name| Schema::new(name, "", &[][..]);
        let json = |name, text: &'static str| Schema::new(name, "jsonschema", text.as_bytes());
        // Foxglove's types always have a schema.
        let known = |schema: Option<Schema>| schema.unwrap_or_else(|| raw(""));
        match self {
            Self::Sweep | Self::Clusters => known(PointCloud::get_schema()),
            Self::Detections | Self::Tracks => known(SceneUpdate::get_schema()),
            Self::Events => known(Log::get_schema()),
            Self::Truth => json("encke.Truth", TRUTH),
            Self::Status => json("encke.Status", STATUS),
            Self::RawSweep => raw(Sweep::TYPE),
            Self::RawClusters => raw(Clusters::TYPE),
            Self::RawDescriptors => raw(Descriptors::TYPE),
            Self::RawDetections => raw(Detections::TYPE),
            Self::RawTracks => raw(TrackTable::TYPE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_stands_at_its_own_number_and_is_configured_by_its_name() {
        for (number, topic) in Topic::ALL.into_iter().enumerate() {
            assert_eq!(topic as usize, number);
            let key = serde_json::to_value(topic).unwrap();
            assert_eq!(topic.name(), format!("/encke/{}", key.as_str().unwrap()));
        }
    }

    #[test]
    fn every_schema_has_a_name_and_those_without_encoding_no_data() {
        for topic in Topic::ALL {
            let schema = topic.schema();
            assert!(!schema.name.is_empty());
            assert_eq!(schema.encoding.is_empty(), schema.data.is_empty(), "{}", schema.name);
            if schema.encoding == "jsonschema" {
                let parsed: serde_json::Value = serde_json::from_slice(&schema.data).unwrap();
                assert_eq!(parsed["title"], schema.name.as_str());
                assert!(parsed["properties"].is_object());
            }
        }
    }
}

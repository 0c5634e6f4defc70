//! Events → `foxglove.Log`; truth → JSON.

use foxglove::messages::Log;
use foxglove::messages::log::Level as Number;
use lidar::ObstacleClass;
use messages::{SolidKind, Truth, TruthObject};
use prost::Message;
use serde::ser::SerializeSeq;
use serde::{Serialize, Serializer};

use crate::stamps::timestamp;

/// How grave an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Of interest to developers.
    Debug,
    /// As it should be.
    Info,
    /// Something is lost or late, and the chain goes on.
    Warning,
    /// Something does not work any more.
    Error,
    /// The chain ends.
    Fatal,
}

/// Something that happened in the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event<'a> {
    /// How grave it is.
    pub level: Level,
    /// Whom it is about: a process of the chain, or `chain`.
    pub name: &'a str,
    /// Its word in the dictionary of events; goes where Foxglove has a source file.
    pub word: &'a str,
    /// Its number in the log of the run; goes where Foxglove has a line (its low 32 bits).
    pub number: u64,
    /// What happened, one line.
    pub message: &'a str,
}

/// Appends an event that is stamped with the sensor time of the moment.
pub(crate) fn put_event(event: &Event<'_>, sensor_time_ns: u64, out: &mut Vec<u8>) {
    let level = match event.level {
        Level::Debug => Number::Debug,
        Level::Info => Number::Info,
        Level::Warning => Number::Warning,
        Level::Error => Number::Error,
        Level::Fatal => Number::Fatal,
    };
    let log = Log {
        timestamp: Some(timestamp(sensor_time_ns)),
        level: level as i32,
        message: event.message.into(),
        name: event.name.into(),
        file: event.word.into(),
        line: event.number as u32,
    };
    out.reserve(log.encoded_len());
    // Fails only where a buffer cannot grow; a vector does.
    let _ = log.encode(out);
}

/// Appends the objects of a truth; whose returns are whose is left out.
pub(crate) fn put_truth(sweep: u64, truth: &Truth, out: &mut Vec<u8>) {
    let told = Told { sweep, sensor_time_ns: truth.sensor_time_ns, objects: Objects(&truth.objects) };
    // Fails only where the writer does; a vector does not.
    let _ = serde_json::to_writer(out, &told);
}

#[derive(Serialize)]
struct Told<'a> {
    sweep: u64,
    sensor_time_ns: u64,
    objects: Objects<'a>,
}

struct Objects<'a>(&'a [TruthObject]);

impl Serialize for Objects<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.0.len()))?;
        for object in self.0 {
            list.serialize_element(&Object {
                id: object.id,
                kind: match object.kind {
                    SolidKind::Box => "box",
                    SolidKind::Ellipsoid => "ellipsoid",
                    SolidKind::Cylinder => "cylinder",
                    SolidKind::Cone => "cone",
                    SolidKind::Mesh => "mesh",
                },
                class: object.class,
                centre_m: object.centre_m,
                attitude_wxyz: object.attitude_wxyz,
                size_m: object.size_m,
                velocity_mps: object.velocity_mps,
                spin_radps: object.spin_radps,
                returns: object.returns,
            })?;
        }
        list.end()
    }
}

#[derive(Serialize)]
struct Object {
    id: u16,
    kind: &'static str,
    class: ObstacleClass,
    centre_m: [f32; 3],
    attitude_wxyz: [f32; 4],
    size_m: [f32; 3],
    velocity_mps: [f32; 3],
    spin_radps: [f32; 3],
    returns: u32,
}

#[cfg(test)]
mod tests {
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn an_event_keeps_its_words_level_and_time() {
        let mut out = Vec::new();
        let (name, word, message) = ("clusterer", "stage_restarted", "restart 1");
        let event = Event { level: Level::Warning, name, word, number: (1 << 32) + 7, message };
        put_event(&event, 2_000_000_005, &mut out);
        let log = Log::decode(&out[..]).unwrap();
        assert_eq!((log.name.as_str(), log.message.as_str()), (name, message));
        assert_eq!((log.file.as_str(), log.line), (word, 7));
        assert_eq!((log.level(), log.timestamp), (Number::Warning, Some(timestamp(2_000_000_005))));
    }

    #[test]
    fn truth_names_every_object_with_pose_size_and_motion() {
        let mut truth = Truth::new_box_zeroed().unwrap();
        truth.sensor_time_ns = 9;
        let object = TruthObject {
            id: 3,
            kind: SolidKind::Cone,
            class: ObstacleClass::Conical,
            centre_m: [1.5, 0.0, -2.0],
            size_m: [1.0, 1.0, 2.5],
            velocity_mps: [0.25, 0.0, 0.0],
            returns: 12,
            ..TruthObject::default()
        };
        truth.objects.push(object).unwrap();
        let mut out = Vec::new();
        put_truth(4, &truth, &mut out);
        let told: serde_json::Value = serde_json::from_slice(&out).unwrap();
        assert_eq!((&told["sweep"], &told["sensor_time_ns"]), (&4.into(), &9.into()));
        let object = &told["objects"][0];
        assert_eq!((&object["kind"], &object["class"]), (&"cone".into(), &"conical".into()));
        assert_eq!(object["centre_m"], serde_json::json!([1.5, 0.0, -2.0]));
        assert_eq!((&object["velocity_mps"][0], &object["returns"]), (&0.25.into(), &12.into()));
    }
}

//! JSON schemas of the messages that are JSON.

/// Of [`crate::Topic::Truth`].
pub(crate) const TRUTH: &str = r#"{
"$schema":"https://json-schema.org/draft/2020-12/schema","title":"encke.Truth","type":"object",
"description":"What the simulator knows of a sweep, at its first firing, sensor frame.",
"properties":{
 "sweep":{"type":"integer"},
 "sensor_time_ns":{"type":"integer"},
 "objects":{"type":"array","items":{"type":"object","properties":{
  "id":{"type":"integer","description":"the same through all sweeps"},
  "kind":{"type":"string","description":"box, ellipsoid, cylinder, cone or mesh"},
  "class":{"type":"string"},
  "centre_m":{"type":"array","items":{"type":"number"}},
  "attitude_wxyz":{"type":"array","items":{"type":"number"},"description":"body to sensor frame"},
  "size_m":{"type":"array","items":{"type":"number"},"description":"full extents along the body's axes"},
  "velocity_mps":{"type":"array","items":{"type":"number"}},
  "spin_radps":{"type":"array","items":{"type":"number"}},
  "returns":{"type":"integer","description":"returns of this sweep on it"}
 }}}
}}"#;

/// Of [`crate::Topic::Status`].
pub(crate) const STATUS: &str = r#"{
"$schema":"https://json-schema.org/draft/2020-12/schema","title":"encke.Status","type":"object",
"description":"The chain's state, as `encke ctl status --json` gives it.",
"properties":{
 "instance":{"type":"string"},
 "mode":{"type":"string"},
 "sweep":{"type":"integer"},
 "sectors":{"type":"integer","description":"so many parts are one sweep"},
 "step":{"type":"string"},
 "latency_ms":{"type":["number","null"]},
 "stages":{"type":"array","items":{"type":"object","properties":{
  "stage":{"type":"string"},
  "pid":{"type":"integer"},
  "state":{"type":"string"},
  "restarts":{"type":"integer"},
  "heartbeat_age_ms":{"type":"number"},
  "received":{"type":"integer"},
  "published":{"type":"integer"},
  "dropped":{"type":"integer"},
  "lost":{"type":"integer"},
  "processed":{"type":"integer"},
  "rejected":{"type":"object","additionalProperties":{"type":"integer"},"description":"by reason"},
  "overruns":{"type":"integer"},
  "slips":{"type":"integer"},
  "late":{"type":"integer"},
  "queue":{"type":["integer","null"]},
  "tier":{"type":"string"},
  "cpu_s":{"type":["number","null"]},
  "rss_mib":{"type":["number","null"]}
 }}}
}}"#;

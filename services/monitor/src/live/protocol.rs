//! Foxglove's WebSocket protocol, as far as a server needs it that only publishes: `foxglove.sdk.v1`, and its older name.
//! Text frames are JSON, message data are binary frames. <https://github.com/foxglove/ws-protocol>

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use tape::Topic;

/// What a client may ask for, the newest first.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// The topics that are served, by the number of their channel.
pub(super) const TOPICS: [Topic; 6] =
    [Topic::Sweep, Topic::Clusters, Topic::Detections, Topic::Events, Topic::Status, Topic::Tracks];

/// A topic's place in [`TOPICS`].
pub(super) fn place(topic: Topic) -> usize {
    TOPICS.iter().position(|served| *served == topic).unwrap_or(0)
}

/// Opcode of message data.
const MESSAGE_DATA: u8 = 1;
/// Opcode, number of the subscription, time.
const HEAD_BYTES: usize = 1 + 4 + 8;

#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum ToClient<'a> {
    ServerInfo { name: &'a str, capabilities: [&'a str; 0], session_id: &'a str },
    Advertise { channels: Vec<Channel> },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Channel {
    id: u32,
    topic: &'static str,
    encoding: &'static str,
    schema_name: String,
    schema: String,
    schema_encoding: String,
}

/// What a client asks for.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum FromClient {
    /// Messages of these channels.
    Subscribe { subscriptions: Vec<Subscription> },
    /// No more of these.
    Unsubscribe { subscription_ids: Vec<u32> },
    /// Something that this server has not offered.
    #[serde(other)]
    Other,
}

/// A number of the client's for a channel of ours.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub(super) id: u32,
    pub(super) channel_id: u32,
}

impl Subscription {
    /// The place in [`TOPICS`] of what is wanted; none for a channel that is not there.
    pub(super) fn place(&self) -> Option<usize> {
        let place = (self.channel_id as usize).checked_sub(1)?;
        (place < TOPICS.len()).then_some(place)
    }
}

/// The first words to a client. Another `session` than before tells it to forget what it has.
pub(super) fn server_info(name: &str, session: &str) -> String {
    json(&ToClient::ServerInfo { name, capabilities: [], session_id: session })
}

/// All channels.
pub(super) fn advertise() -> String {
    let channel = |(topic, id): (Topic, u32)| {
        let schema = topic.schema();
        let text = match &*schema.encoding {
            "jsonschema" => String::from_utf8_lossy(&schema.data).into_owned(),
            _ => STANDARD.encode(&schema.data),
        };
        Channel {
            id,
            topic: topic.name(),
            encoding: topic.message_encoding(),
            schema_name: schema.name,
            schema: text,
            schema_encoding: schema.encoding,
        }
    };
    json(&ToClient::Advertise { channels: TOPICS.into_iter().zip(1..).map(channel).collect() })
}

/// What a text frame of a client says; none where it is no JSON of this protocol.
pub(super) fn parse(text: &str) -> Option<FromClient> {
    serde_json::from_str(text).ok()
}

/// A message for one subscription, `time_ns` being sensor time.
pub(super) fn message_data(subscription: u32, time_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut frame = Vec::with_capacity(HEAD_BYTES + payload.len());
    frame.push(MESSAGE_DATA);
    frame.extend_from_slice(&subscription.to_le_bytes());
    frame.extend_from_slice(&time_ns.to_le_bytes());
    frame.extend_from_slice(payload);
    frame
}

fn json(message: &ToClient<'_>) -> String {
    // Words and numbers alone.
    serde_json::to_string(message).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_is_advertised_with_its_schema_under_its_number() {
        let told: serde_json::Value = serde_json::from_str(&advertise()).unwrap();
        assert_eq!(told["op"], "advertise");
        let channels = told["channels"].as_array().unwrap();
        for (place, (topic, channel)) in TOPICS.iter().zip(channels).enumerate() {
            assert_eq!(channel["id"], place + 1);
            assert_eq!(channel["topic"], topic.name());
            let schema = channel["schema"].as_str().unwrap();
            match channel["schemaEncoding"].as_str().unwrap() {
                "protobuf" => assert_eq!(STANDARD.decode(schema).unwrap()[..], topic.schema().data[..]),
                other => assert_eq!((other, schema.starts_with('{')), ("jsonschema", true)),
            }
        }
        assert_eq!(channels.len(), TOPICS.len());
    }

    #[test]
    fn the_first_words_name_the_server_and_its_session() {
        let told: serde_json::Value = serde_json::from_str(&server_info("encke flight-1", "7")).unwrap();
        assert_eq!((&told["op"], &told["name"]), (&"serverInfo".into(), &"encke flight-1".into()));
        assert_eq!((&told["sessionId"], &told["capabilities"]), (&"7".into(), &serde_json::json!([])));
    }

    #[test]
    fn subscriptions_are_read_and_what_was_not_offered_is_other() {
        let subscribe = parse(r#"{"op":"subscribe","subscriptions":[{"id":9,"channelId":3}]}"#).unwrap();
        let FromClient::Subscribe { subscriptions } = subscribe else { panic!("not a subscription") };
        assert_eq!((subscriptions[0].id, subscriptions[0].place()), (9, Some(2)));
        let unsubscribe = parse(r#"{"op":"unsubscribe","subscriptionIds":[9]}"#);
        assert_eq!(unsubscribe, Some(FromClient::Unsubscribe { subscription_ids: vec![9] }));
        assert_eq!(parse(r#"{"op":"getParameters","parameterNames":[]}"#), Some(FromClient::Other));
        assert_eq!(parse("nothing"), None);
        for channel_id in [0, 7, u32::MAX] {
            assert_eq!(Subscription { id: 1, channel_id }.place(), None);
        }
    }

    #[test]
    fn message_data_have_opcode_subscription_and_time_before_the_payload() {
        assert_eq!(message_data(2, 3, b"x"), [1, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, b'x']);
    }
}

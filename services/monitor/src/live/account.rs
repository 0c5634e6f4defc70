use serde::Serialize;

use super::protocol::TOPICS;

/// Where the messages of all clients went.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Account {
    /// Clients that were served.
    pub clients: u64,
    /// Connections that were not: too many, or no client of this protocol.
    pub refused: u64,
    /// By topic.
    pub topics: Vec<TopicAccount>,
    /// Parts of sweeps that passed unseen: this process was too slow.
    pub unseen_sweep_parts: u64,
    /// Parts of detections that passed unseen, and with them tracks.
    pub unseen_detection_parts: u64,
}

/// Messages of one topic, counted once for each client that had subscribed to it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TopicAccount {
    /// The topic.
    pub topic: &'static str,
    /// Handed to the kernel in full.
    pub sent: u64,
    /// Not encoded: the client had not taken the one before yet.
    pub behind: u64,
    /// Not encoded: not all of the sweep was seen, the client came in the middle of it, or there was no table of tracks.
    pub incomplete: u64,
    /// Encoded, and the client left before it had it.
    pub undelivered: u64,
}

impl Account {
    pub(super) fn new() -> Self {
        let topic = |topic: tape::Topic| TopicAccount { topic: topic.name(), ..TopicAccount::default() };
        Self { topics: TOPICS.map(topic).to_vec(), ..Self::default() }
    }

    /// One line for people, while it goes on.
    pub(super) fn line(&self, now: usize) -> String {
        let sum = |count: fn(&TopicAccount) -> u64| self.topics.iter().map(count).sum::<u64>();
        let dropped = sum(|topic| topic.behind + topic.undelivered) + sum(|topic| topic.incomplete);
        let clients = if now == 1 { "1 client".to_owned() } else { format!("{now} clients") };
        let unseen = self.unseen_sweep_parts + self.unseen_detection_parts;
        format!("{clients}  messages sent {}  dropped {dropped}  parts unseen {unseen}", sum(|topic| topic.sent))
    }

    /// The whole account as a table.
    pub(super) fn table(&self) -> String {
        let mut text = format!("clients {}, refused {}\n", self.clients, self.refused);
        text += "topic                    sent      behind  incomplete  undelivered\n";
        for topic in &self.topics {
            let TopicAccount { topic, sent, behind, incomplete, undelivered } = topic;
            text += &format!("{topic:<18}{sent:>11}{behind:>12}{incomplete:>12}{undelivered:>13}\n");
        }
        let (sweeps, detections) = (self.unseen_sweep_parts, self.unseen_detection_parts);
        text + &format!("parts that passed unseen: {sweeps} of sweeps, {detections} of detections\n")
    }
}

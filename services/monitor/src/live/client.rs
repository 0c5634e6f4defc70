use std::collections::VecDeque;
use std::io;
use std::net::TcpStream;

use tungstenite::protocol::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Error, Message, WebSocket};

use super::account::TopicAccount;
use super::protocol::{self, FromClient, TOPICS};

/// Most subscriptions of a client.
const MAX_SUBSCRIPTIONS: usize = 64;

/// Most messages of a client that are read in one turn: none may keep the others waiting.
const MAX_READ: usize = 64;

/// One viewer. Its socket never blocks; what it does not take is not sent, and counted.
pub(super) struct Client {
    socket: WebSocket<TcpStream>,
    /// Number of its subscription to each topic.
    subscriptions: [Option<u32>; TOPICS.len()],
    /// What waits for the socket: words of the protocol, or at most one message of each topic.
    waiting: VecDeque<(Option<usize>, Message)>,
    /// What the socket is being given.
    writing: Option<Option<usize>>,
    /// Topics of which the latest message was not sent because one was waiting.
    behind: [bool; TOPICS.len()],
    pub(super) counts: [TopicAccount; TOPICS.len()],
    gone: bool,
}

impl Client {
    /// A client that has shaken hands, and what is to be told first.
    pub(super) fn new(socket: WebSocket<TcpStream>, first: &[String]) -> Self {
        Self {
            socket,
            subscriptions: [None; TOPICS.len()],
            waiting: first.iter().map(|text| (None, Message::text(text.clone()))).collect(),
            writing: None,
            behind: [false; TOPICS.len()],
            counts: Default::default(),
            gone: false,
        }
    }

    /// Whether the connection is over.
    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }

    /// The socket, to wait for.
    pub(super) fn stream(&self) -> &TcpStream {
        self.socket.get_ref()
    }

    /// Whether there is something that the socket has not taken yet.
    pub(super) fn is_writing(&self) -> bool {
        self.writing.is_some() || !self.waiting.is_empty()
    }

    /// The number of its subscription to the topic in this place.
    pub(super) fn subscription(&self, place: usize) -> Option<u32> {
        self.subscriptions[place]
    }

    /// Whether the next message of a topic may reach it: it has subscribed and has not fallen behind.
    pub(super) fn wants(&self, place: usize) -> bool {
        self.subscriptions[place].is_some() && !(self.behind[place] && self.has_waiting(place))
    }

    /// Whether one more message of a topic may be put before it; else that it is not is counted.
    pub(super) fn has_room(&mut self, place: usize) -> bool {
        let waits = self.has_waiting(place);
        self.behind[place] = waits;
        self.counts[place].behind += u64::from(waits);
        !waits
    }

    fn has_waiting(&self, place: usize) -> bool {
        self.writing == Some(Some(place)) || self.waiting.iter().any(|(waits, _)| *waits == Some(place))
    }

    /// Puts a message before it.
    pub(super) fn put(&mut self, place: usize, frame: Vec<u8>) {
        self.waiting.push_back((Some(place), Message::binary(frame)));
    }

    /// Tells it something outside of all topics.
    pub(super) fn tell(&mut self, text: &str) {
        self.waiting.push_back((None, Message::text(text)));
    }

    /// Reads what it asks for and gives it what the socket takes, without waiting.
    pub(super) fn turn(&mut self) {
        for _ in 0..MAX_READ {
            match self.socket.read() {
                Ok(Message::Text(text)) => self.answer(&text),
                Ok(_) => {}
                Err(error) => {
                    self.judge(&error);
                    break;
                }
            }
        }
        while !self.gone {
            match self.socket.flush() {
                Ok(()) => {}
                Err(error) => {
                    self.judge(&error);
                    return;
                }
            }
            if let Some(Some(place)) = self.writing.take() {
                self.counts[place].sent += 1;
            }
            let Some((place, message)) = self.waiting.pop_front() else { return };
            self.writing = Some(place);
            // Kept in the socket's buffer where the kernel has no room.
            if let Err(error) = self.socket.write(message) {
                self.judge(&error);
            }
        }
    }

    /// Anything but "not now" is the end of the connection.
    fn judge(&mut self, error: &Error) {
        let later = [io::ErrorKind::WouldBlock, io::ErrorKind::Interrupted];
        self.gone |= !matches!(error, Error::Io(cause) if later.contains(&cause.kind()));
    }

    fn answer(&mut self, text: &str) {
        match protocol::parse(text) {
            Some(FromClient::Subscribe { subscriptions }) => {
                for subscription in subscriptions.iter().take(MAX_SUBSCRIPTIONS) {
                    if let Some(place) = subscription.place() {
                        self.subscriptions[place] = Some(subscription.id);
                    }
                }
            }
            Some(FromClient::Unsubscribe { subscription_ids }) => {
                for slot in &mut self.subscriptions {
                    if slot.is_some_and(|id| subscription_ids.contains(&id)) {
                        *slot = None;
                    }
                }
            }
            // Nothing else was offered.
            Some(FromClient::Other) | None => {}
        }
    }

    /// Ends the connection in order, as far as the socket takes it at once; what waits is undelivered.
    pub(super) fn end(&mut self) {
        let undelivered = self.waiting.drain(..).map(|(place, _)| place).chain(self.writing.take());
        for place in undelivered.flatten() {
            self.counts[place].undelivered += 1;
        }
        if !self.gone {
            let frame = CloseFrame { code: CloseCode::Away, reason: "the chain has ended".into() };
            // It may be gone, or frozen: the connection ends with this object in any case.
            let _ = self.socket.close(Some(frame)).and_then(|()| self.socket.flush());
        }
    }
}

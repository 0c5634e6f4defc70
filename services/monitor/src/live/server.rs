//! The listener and its clients, on one thread: no socket ever blocks.

use std::net::{TcpListener, TcpStream};
use std::os::fd::AsFd;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tape::Topic;
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::handshake::{HandshakeError, MidHandshake};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{ServerHandshake, WebSocket, accept_hdr_with_config};

use super::account::Account;
use super::client::Client;
use super::protocol::{self, SUBPROTOCOLS, place};
use crate::MonitorError;

/// Most clients at once.
const MAX_CLIENTS: usize = 8;
/// Most connections that have not shaken hands yet.
const MAX_GUESTS: usize = 8;
/// Turns within which a connection must have shaken hands: five seconds where nothing else happens.
const GUEST_TURNS: u32 = 250;
/// Longest message of a client [bytes].
const MAX_MESSAGE: usize = 64 * 1024;

const SUBPROTOCOL: &str = "sec-websocket-protocol";

type Check = fn(&Request, Response) -> Result<Response, ErrorResponse>;
type Guest = MidHandshake<ServerHandshake<TcpStream, Check>>;

/// Serves [`protocol::TOPICS`] to whoever connects.
pub(super) struct Server {
    listener: TcpListener,
    guests: Vec<(Guest, u32)>,
    clients: Vec<Client>,
    /// What a client is told first.
    first: [String; 2],
    account: Account,
    scratch: Vec<u8>,
}

impl Server {
    /// Listens on an address; port 0 is any that is free.
    pub(super) fn listen(bind: &str, port: u16, name: &str, session: &str) -> Result<Self, MonitorError> {
        let failed = |cause| MonitorError::Listen { address: format!("{bind}:{port}"), cause };
        let listener = TcpListener::bind((bind, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let first = [protocol::server_info(name, session), protocol::advertise()];
        let (guests, clients) = (Vec::new(), Vec::new());
        Ok(Self { listener, guests, clients, first, account: Account::new(), scratch: Vec::new() })
    }

    /// Where it listens.
    pub(super) fn address(&self) -> String {
        self.listener.local_addr().map_or_else(|_| "nowhere".to_owned(), |address| address.to_string())
    }

    /// Whether only this machine can reach it.
    pub(super) fn is_local(&self) -> bool {
        self.listener.local_addr().is_ok_and(|address| address.ip().is_loopback())
    }

    /// Clients that are connected.
    pub(super) fn clients(&self) -> usize {
        self.clients.len()
    }

    /// Tells all clients to forget what they have: another life of the chain begins.
    pub(super) fn renew(&mut self, name: &str, session: &str) {
        self.first[0] = protocol::server_info(name, session);
        for client in &mut self.clients {
            self.first.iter().for_each(|text| client.tell(text));
        }
    }

    /// Whether a message of a topic would reach anybody.
    pub(super) fn wants(&self, topic: Topic) -> bool {
        self.clients.iter().any(|client| client.wants(place(topic)))
    }

    /// Gives a message to all that have subscribed to its topic and have room for it. It is encoded once, and only where
    /// there is somebody; what `encode` refuses counts as incomplete.
    pub(super) fn offer(&mut self, topic: Topic, time_ns: u64, encode: impl FnOnce(&mut Vec<u8>) -> bool) {
        let place = place(topic);
        let mut encode = Some(encode);
        let mut whole = false;
        for client in &mut self.clients {
            let Some(subscription) = client.subscription(place).filter(|_| client.has_room(place)) else { continue };
            if let Some(encode) = encode.take() {
                self.scratch.clear();
                whole = encode(&mut self.scratch);
            }
            if whole {
                client.put(place, protocol::message_data(subscription, time_ns, &self.scratch));
            } else {
                client.counts[place].incomplete += 1;
            }
        }
    }

    /// Counts a sweep of which there is no message, for all that have subscribed to the topic.
    pub(super) fn skip(&mut self, topic: Topic) {
        let place = place(topic);
        for client in &mut self.clients {
            if client.subscription(place).is_some() && client.has_room(place) {
                client.counts[place].incomplete += 1;
            }
        }
    }

    /// Sleeps until a socket has something to say or takes something, or `patience_ns` have passed, or a signal came.
    pub(super) fn wait(&self, patience_ns: u64) {
        let mut sockets = vec![PollFd::new(&self.listener, PollFlags::IN)];
        sockets.extend(self.guests.iter().map(|(guest, _)| guest.get_ref().get_ref()).map(reads));
        sockets.extend(self.clients.iter().map(|client| {
            let writes = if client.is_writing() { PollFlags::OUT } else { PollFlags::empty() };
            PollFd::from_borrowed_fd(client.stream().as_fd(), PollFlags::IN | writes)
        }));
        let patience = Timespec { tv_sec: 0, tv_nsec: patience_ns.min(999_999_999) as _ };
        // A signal, or no memory to wait in: the caller turns at everything and comes back.
        let _ = poll(&mut sockets, Some(&patience));
    }

    /// Accepts, reads and writes as far as it goes without waiting.
    pub(super) fn turn(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.guests.len() < MAX_GUESTS && stream.set_nonblocking(true).is_ok() {
                // A viewer is to be told at once.
                let _ = stream.set_nodelay(true);
                let shaken = accept_hdr_with_config(stream, choose as Check, Some(config()));
                self.welcome(shaken, 0);
            } else {
                self.account.refused += 1;
            }
        }
        for (guest, turns) in std::mem::take(&mut self.guests) {
            self.welcome(guest.handshake(), turns + 1);
        }
        self.clients.iter_mut().for_each(Client::turn);
        let (gone, here) = std::mem::take(&mut self.clients).into_iter().partition(Client::is_gone);
        self.clients = here;
        self.leave(gone);
    }

    fn welcome(
        &mut self,
        shaken: Result<WebSocket<TcpStream>, HandshakeError<ServerHandshake<TcpStream, Check>>>,
        turns: u32,
    ) {
        match shaken {
            Ok(socket) if self.clients.len() < MAX_CLIENTS => {
                self.account.clients += 1;
                self.clients.push(Client::new(socket, &self.first));
            }
            Err(HandshakeError::Interrupted(guest)) if turns < GUEST_TURNS => self.guests.push((guest, turns)),
            _ => self.account.refused += 1,
        }
    }

    fn leave(&mut self, clients: Vec<Client>) {
        for mut client in clients {
            client.end();
            add(&mut self.account, &client);
        }
    }

    /// Where everything went by now.
    pub(super) fn account(&self) -> Account {
        let mut account = self.account.clone();
        self.clients.iter().for_each(|client| add(&mut account, client));
        account
    }

    /// Ends all connections.
    pub(super) fn end(&mut self) {
        let clients = std::mem::take(&mut self.clients);
        self.leave(clients);
    }
}

fn reads(stream: &TcpStream) -> PollFd<'_> {
    PollFd::from_borrowed_fd(stream.as_fd(), PollFlags::IN)
}

fn add(account: &mut Account, client: &Client) {
    for (sum, counts) in account.topics.iter_mut().zip(&client.counts) {
        sum.sent += counts.sent;
        sum.behind += counts.behind;
        sum.incomplete += counts.incomplete;
        sum.undelivered += counts.undelivered;
    }
}

fn config() -> WebSocketConfig {
    WebSocketConfig::default()
        .read_buffer_size(4 * 1024)
        .max_message_size(Some(MAX_MESSAGE))
        .max_frame_size(Some(MAX_MESSAGE))
}

/// Chooses the subprotocol of those that a client offers.
#[expect(clippy::result_large_err, reason = "tungstenite asks for this type")]
fn choose(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let headers = request.headers().get_all(SUBPROTOCOL).iter().filter_map(|value| value.to_str().ok());
    let offered: Vec<&str> = headers.flat_map(|value| value.split(',')).map(str::trim).collect();
    let Some(chosen) = SUBPROTOCOLS.into_iter().find(|ours| offered.contains(ours)) else {
        let wanted = format!("this server speaks {}", SUBPROTOCOLS.join(" and "));
        let mut refusal = ErrorResponse::new(Some(wanted));
        *refusal.status_mut() = StatusCode::BAD_REQUEST;
        return Err(refusal);
    };
    response.headers_mut().insert(SUBPROTOCOL, HeaderValue::from_static(chosen));
    Ok(response)
}

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::http::{MAX_HEAD, Request, Status, Wanted, answer};
use crate::page;
use crate::shelf::{Recorded, Shelf};
use crate::{Limits, Recording, Selection, ViewError};

/// Connections held at a time. One more, and the oldest is dropped: a client that says nothing keeps nobody out.
const MAX_CLIENTS: usize = 32;

/// Hands out a page and its sweeps over HTTP, on one thread, without a clock.
pub struct Server<S = Recorded> {
    listener: TcpListener,
    address: SocketAddr,
    shelf: S,
    policy: String,
    clients: VecDeque<Client>,
}

struct Client {
    stream: TcpStream,
    head: Vec<u8>,
    /// The answer and how much of it is sent; none while the request is read.
    answer: Option<(Vec<u8>, usize)>,
}

impl Server {
    /// Listens for those who want a recording; port 0 is any that is free. Nothing is answered before [`Server::turn`].
    ///
    /// # Errors
    /// Nothing is selected, or the address cannot be listened on.
    pub fn bind(
        address: SocketAddr,
        recording: Recording,
        selection: Selection,
        limits: Limits,
    ) -> Result<Self, ViewError> {
        Self::of(address, Recorded::new(recording, selection, limits)?)
    }
}

impl<S: Shelf> Server<S> {
    /// Listens for those who want what is on a shelf.
    ///
    /// # Errors
    /// The address cannot be listened on.
    pub fn of(address: SocketAddr, shelf: S) -> Result<Self, ViewError> {
        let listen = |cause| ViewError::Listen { address, cause };
        let listener = TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let bound = listener.local_addr().map_err(listen)?;
        Ok(Self { listener, address: bound, shelf, policy: page::policy(true), clients: VecDeque::new() })
    }

    /// What it hands out.
    pub fn shelf(&mut self) -> &mut S {
        &mut self.shelf
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Waits for something to do, for at most so many milliseconds, and does it.
    ///
    /// # Errors
    /// The listening socket fails. What a client does wrong ends that client only.
    pub fn turn(&mut self, patience_ms: u32) -> Result<(), ViewError> {
        let listen = |address| move |cause| ViewError::Listen { address, cause };
        let mut ports = vec![PollFd::new(&self.listener, PollFlags::IN)];
        for client in &self.clients {
            let wanted = if client.answer.is_some() { PollFlags::OUT } else { PollFlags::IN };
            ports.push(PollFd::new(&client.stream, wanted));
        }
        let patience = Timespec {
            tv_sec: i64::from(patience_ms / 1_000),
            tv_nsec: (i64::from(patience_ms % 1_000) * 1_000_000) as _,
        };
        match poll(&mut ports, Some(&patience)) {
            Err(rustix::io::Errno::INTR) => return Ok(()),
            other => other.map_err(|cause| listen(self.address)(cause.into()))?,
        };
        let ready: Vec<bool> = ports.iter().map(|port| !port.revents().is_empty()).collect();
        let mut stay = VecDeque::new();
        for (mut client, ready) in std::mem::take(&mut self.clients).into_iter().zip(&ready[1..]) {
            if !ready || self.attend(&mut client) {
                stay.push_back(client);
            }
        }
        self.clients = stay;
        if ready[0] { self.accept() } else { Ok(()) }
    }

    fn accept(&mut self) -> Result<(), ViewError> {
        match self.listener.accept() {
            Ok((stream, _)) => {
                if stream.set_nonblocking(true).is_ok() {
                    self.clients.push_back(Client { stream, head: Vec::new(), answer: None });
                }
                if self.clients.len() > MAX_CLIENTS {
                    self.clients.pop_front();
                }
                Ok(())
            }
            // A client that was gone before it was answered, or a limit of the system that others' ends will lift.
            Err(cause) => {
                tracing::debug!(%cause, "not accepted");
                Ok(())
            }
        }
    }

    /// Reads from a client or writes to it; says whether it stays.
    fn attend(&mut self, client: &mut Client) -> bool {
        let Some((answer, sent)) = &mut client.answer else {
            return self.hear(client);
        };
        match client.stream.write(&answer[*sent..]) {
            Ok(0) => return false,
            Ok(count) => *sent += count,
            Err(cause) => return is_patient(&cause),
        }
        if *sent < answer.len() {
            return true;
        }
        let _ = client.stream.shutdown(Shutdown::Write);
        false
    }

    fn hear(&mut self, client: &mut Client) -> bool {
        let mut bytes = [0; 2_048];
        match client.stream.read(&mut bytes) {
            Ok(0) => return false,
            Ok(count) => client.head.extend_from_slice(&bytes[..count]),
            Err(cause) => return is_patient(&cause),
        }
        debug_assert!(client.head.len() < MAX_HEAD + bytes.len());
        let address = self.address;
        if let Some(request) = Request::read(&client.head, &|host| is_ours(host, address)) {
            client.answer = Some((self.answer(request), 0));
        }
        true
    }

    fn answer(&mut self, request: Request) -> Vec<u8> {
        let (text, bare) = ("text/plain; charset=utf-8", "default-src 'none'");
        let refused = |status, said: &str| answer(status, text, bare, said.as_bytes(), request.head_only);
        let (kind, policy, found) = match request.wanted {
            Wanted::Refused(status) => return refused(status, "not here\n"),
            Wanted::Page => ("text/html; charset=utf-8", self.policy.as_str(), self.shelf.page().map(Some)),
            Wanted::Overview => ("application/octet-stream", bare, self.shelf.overview().map(Some)),
            Wanted::Sweep(number) => ("application/octet-stream", bare, self.shelf.sweep(number)),
        };
        match found {
            Ok(Some(body)) => answer(Status::Ok, kind, policy, &body, request.head_only),
            Ok(None) => refused(Status::NotFound, "no such sweep here\n"),
            Err(cause) => refused(Status::Failed, &format!("{cause}\n")),
        }
    }
}

fn is_patient(cause: &std::io::Error) -> bool {
    matches!(cause.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Whether a `Host` names the address listened on. One that listens beyond this machine cannot know its names.
fn is_ours(host: &str, address: SocketAddr) -> bool {
    if !address.ip().is_loopback() {
        return true;
    }
    let name = host.strip_suffix(&format!(":{}", address.port()));
    host == address.to_string() || name.is_some_and(|name| name.eq_ignore_ascii_case("localhost"))
}

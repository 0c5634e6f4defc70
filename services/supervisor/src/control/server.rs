//! The listening end: one thread for all peers. It waits for bytes, never for a peer, and hands whole commands to the
//! supervisor's loop one at a time.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};

use chain::SUPERVISOR;
use crossbeam_channel::{Receiver, Sender, bounded};
use runtime::page::PageMap;
use runtime::{Plan, clock};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::socket_peercred;
use transport::Instance;

use super::lines::{Line, Lines};
use super::rate::Rate;
use super::{Answer, Command, MAX_LINE_BYTES, socket_path};
use crate::SupervisorError;

/// Most peers at a time; more are told so and sent away.
const MAX_PEERS: usize = 16;
/// Most commands that reach the supervisor's loop in a second.
const MAX_PER_S: u32 = 50;
/// Bytes of answers that may wait for a peer; from there on nothing is read from it.
const MAX_UNREAD_BYTES: usize = 1 << 16;
/// Bytes taken from a peer at a time, before the others have their turn.
const READ_BYTES: usize = 1 << 16;
/// A peer that has begun a line, or does not read its answers, is sent away after this time without a byte [ns].
const STALL_NS: u64 = 10_000_000_000;
/// How long nobody is let in after the system has refused a peer (too many open files) [ns].
const REFUSED_NS: u64 = 200_000_000;
/// The longest wait for bytes [ns].
const LOOK_NS: u64 = 1_000_000_000;

/// A command on its way to the loop.
pub(crate) struct Asked {
    pub(crate) command: Command,
    answer: Sender<Answer>,
}

impl Asked {
    /// Tells whoever asked.
    pub(crate) fn answer(&self, answer: Answer) {
        let _ = self.answer.try_send(answer); // room for one, and there is one
    }
}

/// The supervisor's end; the thread ends with it.
pub(crate) struct Server {
    pub(crate) asked: Receiver<Asked>,
    _alive: UnixStream,
}

impl Server {
    /// Listens in the instance's folder.
    pub(crate) fn start(instance: &Instance) -> Result<Self, SupervisorError> {
        let system = |cause| SupervisorError::System { what: "listen for commands".to_owned(), cause };
        let path = socket_path(instance);
        // Of a supervisor that died.
        let _ = std::fs::remove_file(&path);
        let listener = UnixListener::bind(&path).map_err(system)?;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).map_err(system)?;
        listener.set_nonblocking(true).map_err(system)?;
        let (sender, asked) = bounded(1);
        let (alive, ends) = UnixStream::pair().map_err(system)?;
        let page = PageMap::open(&Plan::page_path(instance, SUPERVISOR))?;
        let desk = Desk { page, rate: Rate::per_s(MAX_PER_S), asked: sender };
        let post = Post { listener, ends, peers: Vec::new(), shut_until_ns: 0, desk };
        std::thread::Builder::new().name("commands".to_owned()).spawn(|| post.serve()).map_err(system)?;
        Ok(Self { asked, _alive: alive })
    }
}

/// Somebody who is connected.
struct Peer {
    stream: UnixStream,
    lines: Lines,
    /// Answers that are not written yet.
    unread: Vec<u8>,
    /// Last byte in either direction.
    moved_ns: u64,
    has_hung_up: bool,
    /// It takes no answers any more; what it had said still counts.
    is_deaf: bool,
}

/// What lines are turned into answers with.
struct Desk {
    page: PageMap,
    rate: Rate,
    asked: Sender<Asked>,
}

/// The thread's side.
struct Post {
    listener: UnixListener,
    ends: UnixStream,
    peers: Vec<Peer>,
    shut_until_ns: u64,
    desk: Desk,
}

impl Post {
    fn serve(mut self) {
        let mut bytes = vec![0; READ_BYTES];
        while self.wait() {
            self.let_in();
            for peer in &mut self.peers {
                peer.serve(&mut self.desk, &mut bytes);
            }
            let now_ns = clock::now_ns();
            self.peers.retain(|peer| !peer.is_done(now_ns));
        }
    }

    /// Waits for anything to do; false when the supervisor's end is gone.
    fn wait(&self) -> bool {
        let now_ns = clock::now_ns();
        let is_shut = now_ns < self.shut_until_ns;
        let mut fds = vec![PollFd::new(&self.ends, PollFlags::IN)];
        if !is_shut {
            fds.push(PollFd::new(&self.listener, PollFlags::IN));
        }
        for peer in &self.peers {
            let (mut wanted, can_read) = (PollFlags::empty(), peer.can_read());
            wanted.set(PollFlags::IN, can_read);
            wanted.set(PollFlags::OUT, !peer.unread.is_empty());
            fds.push(PollFd::from_borrowed_fd(peer.stream.as_fd(), wanted));
        }
        let nanoseconds = if is_shut { self.shut_until_ns - now_ns } else { LOOK_NS };
        let timeout =
            Timespec { tv_sec: (nanoseconds / 1_000_000_000) as i64, tv_nsec: (nanoseconds % 1_000_000_000) as i64 };
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) => fds.first().is_some_and(|end| end.revents().is_empty()),
            // Out of kernel memory, or interrupted: not in a circle.
            Err(_) => {
                clock::sleep_ns(REFUSED_NS);
                true
            }
        }
    }

    fn let_in(&mut self) {
        while clock::now_ns() >= self.shut_until_ns {
            match self.listener.accept() {
                Ok((stream, _)) => self.greet(stream),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => self.shut_until_ns = clock::now_ns() + REFUSED_NS,
            }
        }
    }

    fn greet(&mut self, stream: UnixStream) {
        if stream.set_nonblocking(true).is_err() {
            return;
        }
        let own = rustix::process::geteuid();
        let refusal = match socket_peercred(&stream) {
            Ok(peer) if peer.uid == own => None,
            Ok(peer) => {
                let (own, peer) = (own.as_raw(), peer.uid.as_raw());
                Some(format!("this chain takes commands of user {own} alone, and you are user {peer}"))
            }
            Err(cause) => Some(format!("your user is not known: {cause}")),
        };
        let crowd = || format!("{MAX_PEERS} others are connected; try again");
        let refusal = refusal.or_else(|| (self.peers.len() >= MAX_PEERS).then(crowd));
        let mut peer = Peer {
            stream,
            lines: Lines::default(),
            unread: Vec::new(),
            moved_ns: clock::now_ns(),
            has_hung_up: false,
            is_deaf: false,
        };
        match refusal {
            None => self.peers.push(peer),
            Some(text) => {
                peer.tell(&self.desk.refuse(text));
                peer.write();
            }
        }
    }
}

impl Peer {
    /// Whether more is read of it. Not when it does not read itself, so that what waits stays bounded.
    fn can_read(&self) -> bool {
        !self.has_hung_up && self.unread.len() < MAX_UNREAD_BYTES
    }

    fn is_done(&self, now_ns: u64) -> bool {
        let waits = self.lines.is_open() || !self.unread.is_empty();
        let has_stalled = waits && now_ns.saturating_sub(self.moved_ns) > STALL_NS;
        has_stalled || (self.has_hung_up && self.unread.is_empty())
    }

    /// Takes what has come, answers it, and writes what can be written. Never waits for the peer.
    fn serve(&mut self, desk: &mut Desk, bytes: &mut [u8]) {
        if self.can_read() {
            match self.stream.read(bytes) {
                Ok(0) => self.has_hung_up = true,
                Ok(count) => {
                    self.moved_ns = clock::now_ns();
                    self.lines.take(&bytes[..count]);
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(_) => self.has_hung_up = true,
            }
            while let Some(line) = self.lines.next() {
                let answer = desk.answer(line);
                self.tell(&answer);
            }
        }
        self.write();
    }

    fn tell(&mut self, answer: &Answer) {
        if self.is_deaf {
            return;
        }
        // Texts and a flag: this cannot fail.
        self.unread.extend(serde_json::to_vec(answer).unwrap_or_default());
        self.unread.push(b'\n');
    }

    fn write(&mut self) {
        while !self.unread.is_empty() {
            match self.stream.write(&self.unread) {
                Ok(count) => {
                    self.moved_ns = clock::now_ns();
                    self.unread.drain(..count);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => {
                    self.is_deaf = true;
                    self.unread.clear();
                }
            }
        }
    }
}

impl Desk {
    fn refuse(&self, text: String) -> Answer {
        self.page.commands_refused.add(1);
        Answer::no(text)
    }

    fn answer(&mut self, line: Line) -> Answer {
        let command = match line {
            Line::Whole(bytes) => serde_json::from_slice::<Command>(&bytes).map_err(|cause| cause.to_string()),
            Line::TooLong => Err(format!("a line has at least {MAX_LINE_BYTES} bytes, must have fewer")),
        };
        let command = match command {
            Ok(command) => command,
            Err(text) => return self.refuse(text),
        };
        if !self.rate.allow(clock::now_ns()) {
            return self.refuse(format!("more than {MAX_PER_S} commands in a second"));
        }
        let (answer, answered) = bounded(1);
        let handed = self.asked.send(Asked { command, answer }).is_ok();
        let answer = if handed { answered.recv().ok() } else { None };
        match answer {
            Some(answer) if answer.accepted => {
                self.page.commands_accepted.add(1);
                answer
            }
            Some(Answer { text, .. }) => self.refuse(text),
            None => self.refuse("the chain is ending".to_owned()),
        }
    }
}

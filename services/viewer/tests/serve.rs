//! The page served: whoever asks rightly gets it, and nobody else harms it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use support::{file, recorded};
use viewer::{Limits, Recording, Selection, Server};

/// A server on a thread of its own, stopped at the end.
struct Served {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn start(sweeps: u32, selection: Selection) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let recording = Recording::open(&file(&dir, "run.mcap", &recorded(sweeps))).unwrap();
        let loopback = "127.0.0.1:0".parse().unwrap();
        let mut server = Server::bind(loopback, recording, selection, Limits::default()).unwrap();
        let (address, stop) = (server.address(), Arc::new(AtomicBool::new(false)));
        let stopped = Arc::clone(&stop);
        #[allow(clippy::disallowed_methods, reason = "the test is the client")]
        let thread = std::thread::spawn(move || {
            while !stopped.load(Ordering::Relaxed) {
                server.turn(20).unwrap();
            }
            drop(dir);
        });
        Self { address, stop, thread: Some(thread) }
    }

    fn send(&self, request: &[u8]) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.write_all(request).unwrap();
        stream
    }

    /// Head and body of the answer.
    fn ask(&self, request: &[u8]) -> (String, Vec<u8>) {
        let mut bytes = Vec::new();
        self.send(request).read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        (String::from_utf8(bytes[..end].to_vec()).unwrap(), bytes[end + 4..].to_vec())
    }

    fn get(&self, path: &str) -> (String, Vec<u8>) {
        self.ask(format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address).as_bytes())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking());
    }
}

#[test]
fn the_page_comes_without_sweeps_and_they_come_one_by_one() {
    let served = Served::start(3, Selection { first: 1, ..Selection::default() });
    let (head, page) = served.get("/");
    assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.contains("connect-src 'self'"), "{head}");
    let page = String::from_utf8(page).unwrap();
    assert!(page.contains("\"served\":true") && !page.contains("id=\"sweep-"));
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &recorded(3))).unwrap();
    for place in [1, 2] {
        let (head, sweep) = served.get(&format!("/sweep/{place}"));
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n"));
        assert_eq!(sweep, recording.encoded(place, lidar::MAX_RETURNS).unwrap());
    }
    assert!(served.get("/sweep/0").0.starts_with("HTTP/1.1 404"), "not selected");
    assert!(served.get("/sweep/3").0.starts_with("HTTP/1.1 404"), "not there");
}

#[test]
fn a_name_pointed_at_us_from_elsewhere_gets_nothing() {
    let served = Served::start(1, Selection::default());
    let (head, body) = served.ask(b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n");
    assert!(head.starts_with("HTTP/1.1 421"), "{head}");
    assert_eq!(body, b"not here\n");
    let port = served.address.port();
    let localhost = format!("GET / HTTP/1.1\r\nHost: LocalHost:{port}\r\n\r\n");
    assert!(served.ask(localhost.as_bytes()).0.starts_with("HTTP/1.1 200"));
}

#[test]
fn the_head_alone_comes_where_it_is_asked_for() {
    let served = Served::start(1, Selection::default());
    let (head, body) = served.ask(format!("HEAD / HTTP/1.1\r\nHost: {}\r\n\r\n", served.address).as_bytes());
    assert!(head.contains("Content-Length: ") && body.is_empty(), "{head}");
}

#[test]
fn clients_that_stall_babble_or_leave_keep_nobody_out() {
    let served = Served::start(1, Selection::default());
    let stalled: Vec<TcpStream> = (0..50).map(|_| served.send(b"GET / HT")).collect();
    for junk in [&b"\0\xff\r\n\r\n"[..], b"\r\n\r\n\r\n\r\n", &[b'a'; 8_192], b"GET / HTTP/1.1\r\n\r\n"] {
        let (head, _) = served.ask(junk);
        assert!(head.starts_with("HTTP/1.1 4"), "{head}");
    }
    for _ in 0..20 {
        // Gone before the answer.
        drop(served.send(format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", served.address).as_bytes()));
    }
    assert!(served.get("/").0.starts_with("HTTP/1.1 200"));
    drop(stalled);
}

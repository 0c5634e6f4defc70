//! As much of HTTP/1.1 as a scrape needs: one connection after the other, one request each, bounded in size and time.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use runtime::clock;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Longest request, its headers included [bytes].
const MAX_REQUEST: usize = 8 * 1024;
/// How long a client may take for its request, and for the answer [ns].
const PATIENCE_NS: u64 = 1_000_000_000;
/// Connections that are answered between two looks at the signals.
const AT_ONCE: usize = 16;

/// Serves one page at `/metrics`.
pub(super) struct Server {
    listener: TcpListener,
}

impl Server {
    pub(super) fn listen(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener })
    }

    /// Where it listens.
    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Waits for connections, at most `patience_ns`, and answers those that are there. `page` is made for each request that
    /// asks for it.
    pub(super) fn turn(&self, patience_ns: u64, mut page: impl FnMut() -> String) {
        let patience = Timespec { tv_sec: 0, tv_nsec: patience_ns.min(999_999_999) as _ };
        // A signal: the caller looks at it and comes back.
        let _ = poll(&mut [PollFd::new(&self.listener, PollFlags::IN)], Some(&patience));
        for _ in 0..AT_ONCE {
            let Ok((stream, _)) = self.listener.accept() else { return };
            // A client that fails has failed for itself.
            let _ = answer(stream, &mut page);
        }
    }
}

fn answer(mut stream: TcpStream, page: &mut impl FnMut() -> String) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(Duration::from_nanos(PATIENCE_NS)))?;
    let request = read_request(&mut stream)?;
    let (status, body) = match respond(&request) {
        Answer::Page => ("200 OK", page()),
        Answer::Refusal(status, words) => (status, format!("{words}\n")),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    let body = if request.starts_with(b"HEAD ") { "" } else { &body };
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())
}

/// The request as far as the end of its headers, or as far as it is let come.
fn read_request(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let end_ns = clock::now_ns() + PATIENCE_NS;
    let mut request = Vec::with_capacity(MAX_REQUEST);
    let mut block = [0; 1024];
    loop {
        let left_ns = end_ns.saturating_sub(clock::now_ns());
        if left_ns == 0 || is_whole(&request) || request.len() >= MAX_REQUEST {
            return Ok(request);
        }
        stream.set_read_timeout(Some(Duration::from_nanos(left_ns)))?;
        let room = block.len().min(MAX_REQUEST - request.len());
        match stream.read(&mut block[..room]) {
            Ok(0) => return Ok(request),
            Ok(length) => request.extend_from_slice(&block[..length]),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

fn is_whole(request: &[u8]) -> bool {
    request.windows(4).any(|end| end == b"\r\n\r\n")
}

#[derive(Debug, PartialEq, Eq)]
enum Answer {
    Page,
    Refusal(&'static str, &'static str),
}

fn respond(request: &[u8]) -> Answer {
    if !is_whole(request) {
        return match request.len() {
            MAX_REQUEST.. => Answer::Refusal("431 Request Header Fields Too Large", "a request has at most 8 KiB"),
            _ => Answer::Refusal("408 Request Timeout", "a request comes within a second"),
        };
    }
    let line = request.split(|&byte| byte == b'\r').next().unwrap_or_default();
    let words: Vec<&[u8]> = line.split(|&byte| byte == b' ').collect();
    let [method, target, version] = words[..] else {
        return Answer::Refusal("400 Bad Request", "a request is METHOD TARGET HTTP/1.1");
    };
    let path = target.split(|&byte| byte == b'?').next().unwrap_or_default();
    if !version.starts_with(b"HTTP/1.") {
        Answer::Refusal("400 Bad Request", "a request is METHOD TARGET HTTP/1.1")
    } else if method != b"GET" && method != b"HEAD" {
        Answer::Refusal("405 Method Not Allowed", "this server only shows: GET /metrics")
    } else if path != b"/metrics" {
        Answer::Refusal("404 Not Found", "the page is /metrics")
    } else {
        Answer::Page
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(request: &str) -> &'static str {
        match respond(request.as_bytes()) {
            Answer::Page => "200",
            Answer::Refusal(status, _) => &status[..3],
        }
    }

    #[test]
    fn one_page_is_served_and_all_else_is_refused() {
        assert_eq!(status("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n"), "200");
        assert_eq!(status("GET /metrics?name=x HTTP/1.0\r\n\r\n"), "200");
        assert_eq!(status("HEAD /metrics HTTP/1.1\r\n\r\n"), "200");
        assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), "404");
        assert_eq!(status("GET /metrics/../../etc/passwd HTTP/1.1\r\n\r\n"), "404");
        assert_eq!(status("POST /metrics HTTP/1.1\r\n\r\n"), "405");
        assert_eq!(status("GET /metrics SPDY/3\r\n\r\n"), "400");
        assert_eq!(status("\u{0}\u{1}\r\n\r\n"), "400");
        assert_eq!(status("GET /metrics HTTP/1.1\r\nHost: x"), "408");
        assert_eq!(status(&"x".repeat(MAX_REQUEST)), "431");
    }

    #[test]
    fn a_client_that_says_nothing_does_not_keep_the_next_from_its_page() {
        let server = Server::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let address = server.address().unwrap();
        let _silent = TcpStream::connect(address).unwrap();
        let mut client = TcpStream::connect(address).unwrap();
        client.write_all(b"GET /metrics HTTP/1.1\r\n\r\n").unwrap();
        let mut flood = TcpStream::connect(address).unwrap();
        flood.write_all(&[b'x'; 3 * MAX_REQUEST]).unwrap();
        let mut pages = 0;
        server.turn(PATIENCE_NS, || {
            pages += 1;
            "encke_up 0\n".to_owned()
        });
        let mut answer = String::new();
        client.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\nencke_up 0\n"), "{answer}");
        assert!(answer.contains("Content-Length: 11\r\n"), "{answer}");
        assert_eq!(pages, 1);
    }
}

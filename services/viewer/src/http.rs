//! As much of HTTP/1.1 as a page of our own needs: one GET, one answer, and the connection ends.

/// Longest head of a request that is read [bytes].
pub(crate) const MAX_HEAD: usize = 8_192;

/// What a request asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// The page.
    Page,
    /// All sweeps in numbers.
    Overview,
    /// The sweep of this number.
    Sweep(u32),
    /// Nothing that there is: the answer's status.
    Refused(Status),
}

/// Status of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Ok,
    BadRequest,
    NotFound,
    MethodNotAllowed,
    Misdirected,
    HeadTooLarge,
    Failed,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Self::Ok => "200 OK",
            Self::BadRequest => "400 Bad Request",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::Misdirected => "421 Misdirected Request",
            Self::HeadTooLarge => "431 Request Header Fields Too Large",
            Self::Failed => "500 Internal Server Error",
        }
    }
}

/// A request whose head is complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    /// What it asks for.
    pub(crate) wanted: Wanted,
    /// Whether the answer is to come without its body.
    pub(crate) head_only: bool,
}

impl Request {
    const fn refused(status: Status) -> Self {
        Self { wanted: Wanted::Refused(status), head_only: false }
    }

    /// Reads what came so far; none while the head goes on. `is_us` says whether a `Host` is this server: a page from
    /// elsewhere that had its name pointed at us must not read the recording.
    pub(crate) fn read(bytes: &[u8], is_us: &dyn Fn(&str) -> bool) -> Option<Self> {
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n");
        let Some(end) = end else {
            return (bytes.len() >= MAX_HEAD).then_some(Self::refused(Status::HeadTooLarge));
        };
        let Ok(head) = std::str::from_utf8(&bytes[..end]) else { return Some(Self::refused(Status::BadRequest)) };
        let mut lines = head.split("\r\n");
        let words: Vec<&str> = lines.next().unwrap_or_default().split(' ').collect();
        let [method, target, "HTTP/1.1" | "HTTP/1.0"] = words[..] else {
            return Some(Self::refused(Status::BadRequest));
        };
        let head_only = match method {
            "GET" => false,
            "HEAD" => true,
            _ => return Some(Self::refused(Status::MethodNotAllowed)),
        };
        let mut hosts = lines.filter_map(|line| {
            let (name, value) = line.split_once(':')?;
            name.eq_ignore_ascii_case("host").then(|| value.trim())
        });
        let wanted = match (hosts.next(), hosts.next()) {
            (Some(host), None) if is_us(host) => route(target),
            (Some(_), None) => Wanted::Refused(Status::Misdirected),
            _ => Wanted::Refused(Status::BadRequest),
        };
        Some(Self { wanted, head_only })
    }
}

fn route(target: &str) -> Wanted {
    if target == "/" {
        return Wanted::Page;
    }
    if target == "/overview" {
        return Wanted::Overview;
    }
    let number = target.strip_prefix("/sweep/").filter(|digits| digits.bytes().all(|byte| byte.is_ascii_digit()));
    number.and_then(|digits| digits.parse().ok()).map_or(Wanted::Refused(Status::NotFound), Wanted::Sweep)
}

/// An answer as it goes over the wire.
pub(crate) fn answer(status: Status, kind: &str, policy: &str, body: &[u8], head_only: bool) -> Vec<u8> {
    let mut out = format!(
        "HTTP/1.1 {}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Content-Security-Policy: {policy}\r\nX-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n\r\n",
        status.line(),
        body.len(),
    )
    .into_bytes();
    if !head_only {
        out.extend_from_slice(body);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Request> {
        Request::read(text.as_bytes(), &|host| host == "127.0.0.1:8")
    }

    fn wanted(line: &str) -> Wanted {
        read(&format!("{line} HTTP/1.1\r\nhOst: 127.0.0.1:8\r\n\r\n")).unwrap().wanted
    }

    #[test]
    fn only_the_page_and_sweeps_by_number_are_there() {
        assert_eq!(wanted("GET /overview"), Wanted::Overview);
        assert_eq!(wanted("GET /"), Wanted::Page);
        assert_eq!(wanted("GET /sweep/12"), Wanted::Sweep(12));
        for path in ["/sweep/", "/sweep/-1", "/sweep/+1", "/sweep/1/..", "/../etc/passwd", "/favicon.ico", "*"] {
            assert_eq!(wanted(&format!("GET {path}")), Wanted::Refused(Status::NotFound), "{path}");
        }
        let huge = format!("GET /sweep/{}", "9".repeat(40));
        assert_eq!(wanted(&huge), Wanted::Refused(Status::NotFound));
    }

    #[test]
    fn what_is_no_request_is_refused() {
        assert_eq!(wanted("POST /"), Wanted::Refused(Status::MethodNotAllowed));
        for text in ["\r\n\r\n", "GET / HTTP/2\r\n\r\n", "GET  / HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\n\r\n"] {
            assert_eq!(read(text).unwrap().wanted, Wanted::Refused(Status::BadRequest), "{text:?}");
        }
        let bytes = [b"GET /\xff HTTP/1.1".as_slice(), b"\r\n\r\n"].concat();
        let request = Request::read(&bytes, &|_| true).unwrap();
        assert_eq!(request.wanted, Wanted::Refused(Status::BadRequest));
    }

    #[test]
    fn a_name_that_is_not_ours_is_misdirected_and_two_are_wrong() {
        let request = read("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").unwrap();
        assert_eq!(request.wanted, Wanted::Refused(Status::Misdirected));
        let request = read("GET / HTTP/1.1\r\nHost: 127.0.0.1:8\r\nHost: 127.0.0.1:8\r\n\r\n").unwrap();
        assert_eq!(request.wanted, Wanted::Refused(Status::BadRequest));
    }

    #[test]
    fn a_head_that_goes_on_is_waited_for_until_it_is_too_long() {
        assert_eq!(read("GET / HTTP/1.1\r\nHost: 127"), None);
        let long = read(&"a".repeat(MAX_HEAD)).unwrap();
        assert_eq!(long.wanted, Wanted::Refused(Status::HeadTooLarge));
    }
}

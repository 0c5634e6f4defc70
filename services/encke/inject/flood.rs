//! A client of the control socket that does not know when to stop.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use runtime::clock;

use super::Injection;
use crate::Failure;

/// What is sent: no command.
const LINE: &[u8] = b"{\"command\":\"flood\"}\n";
/// Between two bursts [ns].
const BURST_NS: u64 = 1_000_000;

impl Injection {
    /// Sends lines as fast as asked for, as long as asked for, and says how many were taken.
    pub(super) fn flood(&self) -> Result<(), Failure> {
        let path = self.instance.dir().join("control");
        let mut stream = connect(&path)?;
        let (per_s, end_ns) = (self.by() as f64, self.planned.for_s.unwrap_or(1.0) * 1e9);
        let start_ns = clock::now_ns();
        let (mut sent, mut answers) = (0_u64, [0; 1 << 16]);
        loop {
            let passed_ns = (clock::now_ns() - start_ns) as f64;
            if passed_ns >= end_ns {
                break;
            }
            while (sent as f64) < passed_ns * per_s / 1e9 {
                match stream.write(LINE) {
                    Ok(bytes) if bytes == LINE.len() => sent += 1,
                    // Half a line is a line that is no command, too.
                    Ok(_) => {}
                    Err(cause) if cause.kind() == ErrorKind::WouldBlock => break,
                    // Thrown out: the next one comes.
                    Err(_) => {
                        stream = connect(&path)?;
                        break;
                    }
                }
            }
            // Answers are taken, so that nobody waits for this client to read.
            while matches!(stream.read(&mut answers), Ok(bytes) if bytes > 0) {}
            clock::sleep_ns(BURST_NS);
        }
        crate::print(&format!("{sent} lines sent\n"))
    }
}

fn connect(path: &Path) -> Result<UnixStream, Failure> {
    let stream = UnixStream::connect(path).and_then(|stream| stream.set_nonblocking(true).map(|()| stream));
    stream.map_err(|cause| Failure::start(format!("{}: {cause}; this chain takes no commands", path.display())))
}

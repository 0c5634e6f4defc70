use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use transport::Instance;

use super::{Answer, Command, MAX_LINE_BYTES, socket_path};

/// How long the supervisor may take to answer: it may be waiting for a stage to drain.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why a command did not reach its chain.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// The chain belongs to somebody else.
    #[error("{0}: this chain belongs to another user, and takes commands of that user alone")]
    OtherUser(PathBuf),
    /// The socket cannot be had, or breaks.
    #[error("{path}: {cause}; does the chain still run?")]
    Socket {
        /// The socket.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The tables are too long.
    #[error("the command is {0} bytes, must be below {MAX_LINE_BYTES}: shorten the files")]
    TooLong(usize),
    /// Something else answers there.
    #[error("{path}: {answer:?} is no answer of this version")]
    Answer {
        /// The socket.
        path: PathBuf,
        /// What came.
        answer: String,
    },
}

/// Gives a command to a running chain and waits for its answer.
///
/// # Errors
/// The chain is another user's, has ended, or does not answer within 10 s.
pub fn command(instance: &Instance, command: &Command) -> Result<Answer, ControlError> {
    let path = socket_path(instance);
    let socket = |cause: std::io::Error| match cause.kind() {
        ErrorKind::PermissionDenied => ControlError::OtherUser(path.clone()),
        _ => ControlError::Socket { path: path.clone(), cause },
    };
    // A command is numbers and texts: this cannot fail.
    let mut line = serde_json::to_vec(command).unwrap_or_default();
    line.push(b'\n');
    if line.len() > MAX_LINE_BYTES {
        return Err(ControlError::TooLong(line.len()));
    }
    let mut stream = UnixStream::connect(&path).map_err(socket)?;
    stream.set_read_timeout(Some(PATIENCE)).map_err(socket)?;
    stream.set_write_timeout(Some(PATIENCE)).map_err(socket)?;
    // A chain that refuses this user answers and hangs up before it has read.
    let written = stream.write_all(&line);
    let mut answer = String::new();
    let read = BufReader::new(stream.take(MAX_LINE_BYTES as u64)).read_line(&mut answer);
    if answer.is_empty() {
        written.map_err(socket)?;
        read.map_err(socket)?;
        return Err(socket(ErrorKind::UnexpectedEof.into()));
    }
    serde_json::from_str(&answer)
        .map_err(|_| ControlError::Answer { path: path.clone(), answer: answer.trim().to_owned() })
}

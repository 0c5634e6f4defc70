//! `encke bench --hop`: what it takes to hand a sweep to a process that sleeps, through the chain's shared memory and
//! through a Unix socket, by turns.
//!
//! This process writes, a second one (`encke bench-hop-peer`) reads. The clock runs from just before a message is sent to
//! when the reader, woken, holds all of it and has read its first and its last return.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use lidar::Return;
use messages::Sweep;
use runtime::clock;
use rustix::fs::{FlockOperation, flock};
use serde::Serialize;
use transport::{Inlet, Instance, Node, Outlet, ServiceHold};
use zerocopy::IntoBytes;

use crate::Failure;
use crate::assets::Assets;
use crate::cli::{BenchArgs, HopPeerArgs};

/// Returns of a message: all firings of a HDL-32E at 10 Hz, 1.1 MB.
const RETURNS: usize = 32 * 2_170;
/// As in `config/chain.toml`.
const QUEUE_PARTS: usize = 4;
/// Messages of either kind before the first that counts.
const WARM_UP: u32 = 20;
/// From one message to the next; long enough for the reader to be asleep again.
const PERIOD_NS: u64 = 5_000_000;
/// The other process is given up after this.
const PATIENCE: Duration = Duration::from_secs(10);

/// Times both ways and prints what they took.
pub(super) fn hop(args: &BenchArgs, assets: &Assets) -> Result<(), Failure> {
    let house = House::take(&assets.text("iceoryx2.toml").map_err(Failure::start)?)?;
    let measured = Writer::start(&house.instance, args.runs).and_then(|writer| writer.measure(args.runs));
    let removed = house.leave();
    let hops = measured?;
    removed?;
    let text = if args.json { serde_json::to_string(&hops).map_err(Failure::run)? + "\n" } else { table(&hops) };
    crate::print(&text)
}

/// The reading end, in a process of its own. Its standard input is the socket.
pub(crate) fn peer(args: &HopPeerArgs) -> Result<(), Failure> {
    let instance = Instance::named(&args.instance).map_err(Failure::start)?;
    let node = Node::join(&instance, "hop-reader", QUEUE_PARTS).map_err(Failure::start)?;
    let inlet = node.inlet::<Sweep>().map_err(Failure::start)?;
    // Not as `Stdin`, whose buffer would be one copy more.
    let mut socket = UnixStream::from(std::io::stdin().as_fd().try_clone_to_owned().map_err(Failure::start)?);
    let mut received = vec![Return::default(); RETURNS];
    reply(&mut socket, 0)?;
    for number in 0..args.messages {
        let held_ns = take(&inlet, number)?;
        reply(&mut socket, held_ns)?;
        socket.read_exact(received.as_mut_bytes()).map_err(|cause| gone("writer", &cause))?;
        let held_ns = read_at(&received, number)?;
        reply(&mut socket, held_ns)?;
    }
    Ok(())
}

/// Waits for the message through shared memory; when it was held.
fn take(inlet: &Inlet<Sweep>, number: u32) -> Result<u64, Failure> {
    let end_ns = clock::now_ns() + PATIENCE.as_nanos() as u64;
    loop {
        inlet.wait(PATIENCE).map_err(Failure::run)?;
        if let Some(taken) = inlet.take().map_err(Failure::run)? {
            return read_at(&taken.message().returns, number);
        }
        if clock::now_ns() >= end_ns {
            return Err(Failure::run(format!("no message within {} s", PATIENCE.as_secs())));
        }
    }
}

/// Reads the first and the last return, then the clock. Both must carry the message's number.
fn read_at(returns: &[Return], number: u32) -> Result<u64, Failure> {
    let ends = (returns.first().map(|r| r.x), returns.last().map(|r| r.x));
    let now_ns = clock::now_ns();
    let expected = Some(number as f32);
    if ends != (expected, expected) || returns.len() != RETURNS {
        return Err(Failure::run(format!("message {number} came with {} returns and ends {ends:?}", returns.len())));
    }
    Ok(now_ns)
}

fn reply(socket: &mut UnixStream, ns: u64) -> Result<(), Failure> {
    socket.write_all(&ns.to_le_bytes()).map_err(|cause| gone("writer", &cause))
}

fn gone(who: &str, cause: &std::io::Error) -> Failure {
    Failure::run(format!("the hop's {who} is gone: {cause}"))
}

/// The writing end, and the reader's process.
struct Writer {
    // Dropped in this order: an outlet before its service.
    outlet: Outlet<Sweep>,
    _service: ServiceHold,
    _node: Node,
    reader: Reader,
}

/// The reader's process; ends with this.
struct Reader {
    process: Child,
    socket: UnixStream,
}

impl Writer {
    /// Creates the service, starts the reader and waits until it listens.
    fn start(instance: &Instance, runs: u32) -> Result<Self, Failure> {
        let node = Node::join(instance, "hop-writer", QUEUE_PARTS).map_err(Failure::start)?;
        let service = node.create::<Sweep>().map_err(Failure::start)?;
        let mut reader = Reader::start(instance, runs.saturating_add(WARM_UP))?;
        reader.reply_ns()?;
        let outlet = node.outlet::<Sweep>().map_err(Failure::start)?;
        Ok(Self { outlet, _service: service, _node: node, reader })
    }

    fn measure(mut self, runs: u32) -> Result<Hops, Failure> {
        let mut returns = made_up();
        let mut message = Vec::with_capacity(RETURNS);
        let (mut shared_ns, mut socket_ns) = (Vec::new(), Vec::new());
        let mut next_ns = clock::now_ns();
        for number in 0..runs.saturating_add(WARM_UP) {
            for end in [0, RETURNS - 1] {
                returns[end].x = number as f32;
            }
            next_ns += PERIOD_NS;
            let shared = self.through_shared_memory(&returns, next_ns)?;
            next_ns += PERIOD_NS;
            let socket = self.through_socket(&returns, &mut message, next_ns)?;
            if number >= WARM_UP {
                shared_ns.push(shared);
                socket_ns.push(socket);
            }
            // After a hold-up messages are not made up for: the reader must sleep.
            next_ns = next_ns.max(clock::now_ns());
        }
        let [shared_memory, socket] = [shared_ns, socket_ns].map(Took::of);
        let ratio_p50 = socket.p50_us / shared_memory.p50_us;
        let bytes = RETURNS * size_of::<Return>();
        Ok(Hops { who: "encke", stage: "hop", returns: RETURNS, bytes, runs, shared_memory, socket, ratio_p50 })
    }

    /// Writes a message in shared memory, then sends it; what sending took [ns].
    fn through_shared_memory(&mut self, returns: &[Return], at_ns: u64) -> Result<u64, Failure> {
        clock::sleep_until_ns(at_ns);
        let mut loan = self.outlet.loan().map_err(Failure::run)?;
        loan.message_mut().returns.extend_from_slice(returns).map_err(Failure::run)?;
        let sent_ns = clock::now_ns();
        loan.send().map_err(Failure::run)?;
        Ok(self.reader.reply_ns()?.saturating_sub(sent_ns))
    }

    /// Writes a message in this process's memory, then the same bytes into the socket; what the latter took [ns].
    fn through_socket(&mut self, returns: &[Return], message: &mut Vec<Return>, at_ns: u64) -> Result<u64, Failure> {
        clock::sleep_until_ns(at_ns);
        message.clear();
        message.extend_from_slice(returns);
        let sent_ns = clock::now_ns();
        self.reader.socket.write_all(message.as_bytes()).map_err(|cause| gone("reader", &cause))?;
        Ok(self.reader.reply_ns()?.saturating_sub(sent_ns))
    }
}

impl Reader {
    fn start(instance: &Instance, messages: u32) -> Result<Self, Failure> {
        let (socket, theirs) = UnixStream::pair().map_err(Failure::start)?;
        for set in [UnixStream::set_read_timeout, UnixStream::set_write_timeout] {
            set(&socket, Some(PATIENCE)).map_err(Failure::start)?;
        }
        let process = Command::new("/proc/self/exe")
            .args(["bench-hop-peer", "--instance", instance.name(), "--messages", &messages.to_string()])
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .spawn()
            .map_err(|cause| Failure::start(format!("cannot start the hop's reader: {cause}")))?;
        Ok(Self { process, socket })
    }

    /// The reader's next word: when it held the message [ns].
    fn reply_ns(&mut self) -> Result<u64, Failure> {
        let mut word = [0; 8];
        self.socket.read_exact(&mut word).map_err(|cause| gone("reader", &cause))?;
        Ok(u64::from_le_bytes(word))
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // It leaves by itself after its last reply, and at once when something failed on this side: it would wait.
        let _ = self.socket.shutdown(std::net::Shutdown::Both);
        if !clock::wait_for(1_000_000_000, || matches!(self.process.try_wait(), Ok(Some(_)))) {
            let _ = self.process.kill();
            let _ = self.process.wait();
        }
    }
}

/// Returns as a sweep could have them.
fn made_up() -> Vec<Return> {
    let at = |place: usize| (place as f32 * 1e-3, (place / 32) as u16, (place % 32) as u8);
    (0..RETURNS).map(at).map(|(y, column, ring)| Return { y, column, ring, ..Return::default() }).collect()
}

/// An instance that is locked as the supervisor locks one, so that a chain that starts does not take it for remains.
struct House {
    instance: Instance,
    _lock: File,
}

impl House {
    fn take(iceoryx2_config: &str) -> Result<Self, Failure> {
        let instance = Instance::named(&format!("hop-{}", std::process::id())).map_err(Failure::start)?;
        instance.make_private_dir().map_err(Failure::start)?;
        let _starting = lock(&Instance::base_dir().join(".lock"))?;
        instance.make_private_dir().map_err(Failure::start)?;
        let mut lock = lock(&instance.dir().join("lock"))?;
        writeln!(lock, "{}", std::process::id()).map_err(Failure::start)?;
        instance.write_config(iceoryx2_config, std::process::id()).map_err(Failure::start)?;
        Ok(Self { instance, _lock: lock })
    }

    fn leave(self) -> Result<(), Failure> {
        let _starting = lock(&Instance::base_dir().join(".lock"))?;
        self.instance.remove().map_err(Failure::run)
    }
}

fn lock(path: &Path) -> Result<File, Failure> {
    let failed = |cause: &dyn std::fmt::Display| Failure::start(format!("{}: {cause}", path.display()));
    let open = OpenOptions::new().create(true).truncate(false).read(true).write(true).mode(0o600).open(path);
    let file = open.map_err(|cause| failed(&cause))?;
    flock(&file, FlockOperation::LockExclusive).map_err(|cause| failed(&cause))?;
    Ok(file)
}

/// What both ways took, as `--json` prints it.
#[derive(Serialize)]
struct Hops {
    who: &'static str,
    stage: &'static str,
    returns: usize,
    bytes: usize,
    /// Messages that count, each way.
    runs: u32,
    shared_memory: Took,
    socket: Took,
    /// Socket over shared memory, at the median.
    ratio_p50: f64,
}

/// From sent to held [µs].
#[derive(Debug, PartialEq, Serialize)]
struct Took {
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

impl Took {
    /// Percentiles by nearest rank; zeros for none.
    fn of(mut ns: Vec<u64>) -> Self {
        ns.sort_unstable();
        let at = |share: f64| {
            let rank = (share * ns.len() as f64).ceil() as usize;
            ns.get(rank.saturating_sub(1)).map_or(0.0, |&ns| ns as f64 / 1e3)
        };
        Self { p50_us: at(0.5), p99_us: at(0.99), max_us: at(1.0) }
    }
}

fn table(hops: &Hops) -> String {
    let row = |name: &str, took: &Took| {
        format!("{name:<14} {:>9.1} {:>9.1} {:>9.1}\n", took.p50_us, took.p99_us, took.max_us)
    };
    format!(
        "hop of {} returns, {} bytes, to a process that sleeps; {} messages each way\n{:<14} {:>9} {:>9} {:>9}\n{}{}\
         socket / shared memory at the median: {:.1}\n",
        hops.returns,
        hops.bytes,
        hops.runs,
        "from sent [us]",
        "p50",
        "p99",
        "max",
        row("shared memory", &hops.shared_memory),
        row("socket", &hops.socket),
        hops.ratio_p50,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_is_the_least_that_so_many_do_not_exceed() {
        let took = Took::of((1..=200).rev().map(|us| us * 1_000).collect());
        assert_eq!(took, Took { p50_us: 100.0, p99_us: 198.0, max_us: 200.0 });
        assert_eq!(Took::of(vec![3_000]), Took { p50_us: 3.0, p99_us: 3.0, max_us: 3.0 });
        assert_eq!(Took::of(Vec::new()), Took { p50_us: 0.0, p99_us: 0.0, max_us: 0.0 });
    }
}

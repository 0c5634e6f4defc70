//! The way in: one thread takes datagrams from the socket into a ring; the room takes packets from the ring.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, bounded};

use lidar::SensorModel;

use super::LiveAddress;
use super::drops::KernelDrops;
use crate::capture::Arrival;
use crate::error::Place;
use crate::velodyne::{PACKET_BYTES, Packet, SpacingWatch, is_of_another};

/// Packets that the ring holds: a second of an HDL-32E, half of one in dual-return mode.
const RING: usize = 2_048;
/// What is asked of the kernel for the socket [bytes]; it grants up to `net.core.rmem_max`.
const BUFFER_BYTES: usize = 4 << 20;
/// Longest datagram that Ethernet brings in one piece, and more.
const DATAGRAM_BYTES: usize = 2_048;
/// The thread looks up from an idle socket this often.
const IDLE: Duration = Duration::from_millis(50);
/// Between two looks at the kernel's count on a busy socket [ns].
const LOOK_NS: u64 = 1_000_000_000;
/// Errors of the socket in a row that end it.
const MAX_ERRORS: u32 = 100;
/// One wait for a packet.
const WAIT: Duration = Duration::from_millis(20);
/// Packets that one call of the room works on at most: some 35 ms of an HDL-32E.
const BUDGET: u32 = 64;

/// What arrived and what became of it: counts since the start.
#[derive(Debug, Default)]
pub struct Traffic {
    packets: AtomicU64,
    other_length: AtomicU64,
    other_sender: AtomicU64,
    other_product: AtomicU64,
    /// Factory byte of the latest of these.
    other_id: AtomicU8,
    other_spacing: AtomicU64,
    ring_full: AtomicU64,
    kernel_drops: AtomicU64,
}

impl Traffic {
    /// Data packets that were taken.
    pub fn packets(&self) -> u64 {
        self.packets.load(Relaxed)
    }

    /// Datagrams that are no data packet by their length (position packets, say).
    pub fn other_length(&self) -> u64 {
        self.other_length.load(Relaxed)
    }

    /// Datagrams of senders that are not accepted.
    pub fn other_sender(&self) -> u64 {
        self.other_sender.load(Relaxed)
    }

    /// Data packets that say to be of another kind of sensor.
    pub fn other_product(&self) -> u64 {
        self.other_product.load(Relaxed)
    }

    /// What the latest of these says of its sensor.
    pub(super) fn other_id(&self) -> u8 {
        self.other_id.load(Relaxed)
    }

    /// Of the packets taken, those that were left out because they are as far apart as only another kind of sensor's are.
    pub fn other_spacing(&self) -> u64 {
        self.other_spacing.load(Relaxed)
    }

    /// Data packets that came while the ring was full.
    pub fn ring_full(&self) -> u64 {
        self.ring_full.load(Relaxed)
    }

    /// Datagrams that the kernel dropped, where it tells.
    pub fn kernel_drops(&self) -> u64 {
        self.kernel_drops.load(Relaxed)
    }

    /// All datagrams that reached the socket, as far as is known.
    pub fn arrived(&self) -> u64 {
        let refused = self.other_length() + self.other_sender() + self.other_product();
        self.packets() + refused + self.ring_full() + self.kernel_drops()
    }
}

/// A data packet on its way through the ring.
struct Datagram {
    host_ns: u64,
    bytes: [u8; PACKET_BYTES],
}

/// Data packets of a live sensor. Its thread ends with it.
pub(crate) struct Intake {
    name: PathBuf,
    local: SocketAddr,
    ring: Receiver<Datagram>,
    traffic: Arc<Traffic>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Packets taken from the ring.
    number: u64,
    budget: u32,
    /// Waits in a row that brought nothing.
    silent: u32,
    spacing: SpacingWatch,
    /// Another kind of sensor has just begun to send.
    has_changed: bool,
}

impl Intake {
    /// Opens the socket and starts the thread. `wall_ns` is the host's clock [ns since 1970].
    pub(super) fn open(address: &LiveAddress, sensor: &SensorModel, wall_ns: fn() -> u64) -> io::Result<Self> {
        let socket = UdpSocket::bind(address.listen())?;
        match address.listen().ip() {
            IpAddr::V4(group) if group.is_multicast() => socket.join_multicast_v4(&group, &Ipv4Addr::UNSPECIFIED)?,
            IpAddr::V6(group) if group.is_multicast() => join_v6(&socket, &group)?,
            _ => {}
        }
        socket.set_read_timeout(Some(IDLE))?;
        // What the kernel grants is looked at, not what it says to the wish.
        let _ = rustix::net::sockopt::set_socket_recv_buffer_size(&socket, BUFFER_BYTES);
        let granted = rustix::net::sockopt::socket_recv_buffer_size(&socket).unwrap_or(0);
        if granted < BUFFER_BYTES {
            tracing::info!(
                bytes = granted,
                wanted = BUFFER_BYTES,
                "the kernel grants the live sensor a small buffer; raise net.core.rmem_max if it drops packets"
            );
        }
        let local = socket.local_addr()?;
        let (sender, ring) = bounded(RING);
        let (traffic, stop) = (Arc::new(Traffic::default()), Arc::new(AtomicBool::new(false)));
        let post = Post {
            drops: KernelDrops::of(&socket),
            socket,
            address: *address,
            product_id: sensor.product_id(),
            wall_ns,
            ring: sender,
            traffic: Arc::clone(&traffic),
            stop: Arc::clone(&stop),
        };
        let thread = std::thread::Builder::new().name("live sensor".to_owned()).spawn(|| post.serve())?;
        let name = PathBuf::from(address.to_string());
        Ok(Self {
            name,
            local,
            ring,
            traffic,
            stop,
            thread: Some(thread),
            number: 0,
            budget: 0,
            silent: 0,
            spacing: SpacingWatch::of(sensor),
            has_changed: false,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.name
    }

    pub(super) fn local(&self) -> SocketAddr {
        self.local
    }

    pub(super) fn traffic(&self) -> &Arc<Traffic> {
        &self.traffic
    }

    /// Lets the room work on some more packets.
    pub(super) fn renew(&mut self) {
        self.budget = BUDGET;
    }

    /// Drops the packets that wait; they count as taken.
    pub(super) fn discard(&mut self) {
        self.number += self.ring.try_iter().count() as u64;
    }

    /// How long nothing has come.
    pub(super) fn silence(&self) -> Duration {
        WAIT * self.silent
    }

    /// Packets taken so far.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Whether the thread has given the socket up.
    pub(super) fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// The spacing of the packets, and what it should be [µs], where it is that of another kind of sensor.
    pub(super) fn another_us(&self) -> Option<(u64, u64)> {
        self.spacing.another_us().map(|found_us| (found_us, self.spacing.expected_us()))
    }

    /// Whether another kind of sensor has begun to send since this was asked last.
    pub(super) fn take_change(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    /// The next packet; nothing when none comes for a while, or it is time to look up. Those of another kind of sensor are
    /// left out.
    pub(crate) fn next(&mut self, packet: &mut Packet) -> Option<Arrival> {
        loop {
            self.budget = self.budget.checked_sub(1)?;
            let Some((received, arrival)) = self.receive() else {
                self.budget = 0;
                return None;
            };
            let was_another = self.spacing.another_us().is_some();
            self.spacing.look(&received);
            if self.spacing.another_us().is_none() {
                *packet = received;
                return Some(arrival);
            }
            self.has_changed |= !was_another;
            self.traffic.other_spacing.fetch_add(1, Relaxed);
        }
    }

    /// The next packet, whatever it is; nothing when none comes for a while.
    pub(super) fn receive(&mut self) -> Option<(Packet, Arrival)> {
        match self.ring.recv_timeout(WAIT) {
            Ok(Datagram { host_ns, bytes }) => {
                self.silent = 0;
                self.number += 1;
                Some((Packet { bytes }, Arrival { host_ns, place: Place::Packet(self.number) }))
            }
            Err(_) => {
                self.silent = self.silent.saturating_add(1);
                None
            }
        }
    }
}

impl Drop for Intake {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            // It does not panic; if it did, there is nothing to save.
            let _ = thread.join();
        }
    }
}

fn join_v6(socket: &UdpSocket, group: &Ipv6Addr) -> io::Result<()> {
    socket.join_multicast_v6(group, 0)
}

/// The thread's side.
struct Post {
    socket: UdpSocket,
    address: LiveAddress,
    product_id: u8,
    wall_ns: fn() -> u64,
    ring: Sender<Datagram>,
    traffic: Arc<Traffic>,
    stop: Arc<AtomicBool>,
    drops: KernelDrops,
}

impl Post {
    /// Takes datagrams until it is told to stop, or the socket fails for good.
    fn serve(mut self) {
        let mut bytes = [0; DATAGRAM_BYTES];
        let (mut errors, mut looked_ns, mut is_new) = (0, 0, false);
        // The first look takes the memory that all others need.
        self.count_drops();
        while !self.stop.load(Relaxed) && errors < MAX_ERRORS {
            let received = self.socket.recv_from(&mut bytes);
            let now_ns = (self.wall_ns)();
            match received {
                Ok((length, sender)) => {
                    errors = 0;
                    is_new = true;
                    self.take(&bytes[..length], sender.ip(), now_ns);
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    errors = 0;
                    if std::mem::take(&mut is_new) {
                        self.count_drops();
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => errors += 1,
            }
            if now_ns.abs_diff(looked_ns) >= LOOK_NS {
                looked_ns = now_ns;
                self.count_drops();
            }
        }
    }

    fn take(&self, bytes: &[u8], sender: IpAddr, host_ns: u64) {
        let traffic = &self.traffic;
        let count = if !self.address.accepts(sender) {
            &traffic.other_sender
        } else if let Ok(&bytes) = <&[u8; PACKET_BYTES]>::try_from(bytes) {
            let product_id = bytes[PACKET_BYTES - 1];
            if is_of_another(product_id, self.product_id) {
                traffic.other_id.store(product_id, Relaxed);
                &traffic.other_product
            } else if self.ring.try_send(Datagram { host_ns, bytes }).is_ok() {
                &traffic.packets
            } else {
                &traffic.ring_full
            }
        } else {
            &traffic.other_length
        };
        count.fetch_add(1, Relaxed);
    }

    fn count_drops(&mut self) {
        if let Some(drops) = self.drops.count() {
            self.traffic.kernel_drops.store(drops, Relaxed);
        }
    }
}

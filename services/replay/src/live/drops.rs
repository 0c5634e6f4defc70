//! Datagrams that the kernel dropped because the socket's buffer was full, as Linux tells them in `/proc/net`.

use std::fs::File;
use std::io::Read;
use std::net::UdpSocket;

/// Most bytes of the table that are read: some 8,000 sockets.
const MAX_BYTES: u64 = 1 << 20;
/// Places of a socket's inode and drops in its line, as `Documentation/networking/proc_net_udp` of Linux has them.
const INODE: usize = 9;
const DROPS: usize = 12;

/// The count of one socket.
pub(super) struct KernelDrops {
    table: &'static str,
    inode: u64,
    text: Vec<u8>,
}

impl KernelDrops {
    pub(super) fn of(socket: &UdpSocket) -> Self {
        let is_v6 = socket.local_addr().is_ok_and(|address| address.is_ipv6());
        let inode = rustix::fs::fstat(socket).map_or(0, |stat| stat.st_ino);
        Self { table: if is_v6 { "/proc/net/udp6" } else { "/proc/net/udp" }, inode, text: Vec::with_capacity(1 << 16) }
    }

    /// All that were dropped up to now; none where the system does not tell.
    pub(super) fn count(&mut self) -> Option<u64> {
        self.text.clear();
        File::open(self.table).and_then(|file| file.take(MAX_BYTES).read_to_end(&mut self.text)).ok()?;
        let text = std::str::from_utf8(&self.text).ok()?;
        text.lines().find_map(|line| drops(line, self.inode))
    }
}

/// The drops in a line of the table if it is the socket's.
fn drops(line: &str, inode: u64) -> Option<u64> {
    let mut fields = line.split_ascii_whitespace().skip(INODE);
    (fields.next()?.parse() == Ok(inode)).then_some(())?;
    fields.nth(DROPS - INODE - 1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_are_read_from_the_line_of_the_sockets_inode() {
        let line = "  423: 0100007F:0940 00000000:0000 07 00000000:00000000 00:00000000 00000000  0        0 9417 2 0000000000000000 17";
        assert_eq!(drops(line, 9_417), Some(17));
        assert_eq!(drops(line, 9_418), None);
        assert_eq!(drops("  sl  local_address rem_address   st tx_queue", 9_417), None);
        assert_eq!(drops("1: 2 3 4 5 6 7 8 9 9417 2", 9_417), None);
    }
}

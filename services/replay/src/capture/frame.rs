//! From a captured frame to what its UDP datagram carries.

use etherparse::{EtherType, LaxSlicedPacket, TransportSlice};

/// Link types of the pcap registry (tcpdump.org/linktypes.html) that can carry a sensor's packets.
const NULL: i32 = 0;
const ETHERNET: i32 = 1;
const RAW_BSD: [i32; 2] = [12, 14];
const RAW: i32 = 101;
const LOOP: i32 = 108;
const LINUX_SLL: i32 = 113;
const IPV4: i32 = 228;
const IPV6: i32 = 229;
const LINUX_SLL2: i32 = 276;

/// What a captured frame turned out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frame<'a> {
    /// A whole UDP datagram's payload; ports and addresses are not looked at: recorders and older units differ.
    Udp(&'a [u8]),
    /// Something else that is none of ours (ARP, TCP, a fragment).
    Other,
    /// It cannot be taken apart, or was cut off by the capture's snap length.
    Bad,
}

/// Takes apart a frame of `link` type; VLAN tags and IP options are stepped over.
pub(crate) fn parse(link: i32, frame: &[u8]) -> Frame<'_> {
    let sliced = match link {
        ETHERNET => LaxSlicedPacket::from_ethernet(frame).ok(),
        NULL | LOOP => frame.get(4..).and_then(|ip| LaxSlicedPacket::from_ip(ip).ok()),
        RAW | IPV4 | IPV6 => LaxSlicedPacket::from_ip(frame).ok(),
        _ if RAW_BSD.contains(&link) => LaxSlicedPacket::from_ip(frame).ok(),
        LINUX_SLL => cooked(frame, 14, 16),
        LINUX_SLL2 => cooked(frame, 0, 20),
        _ => return Frame::Other,
    };
    let Some(sliced) = sliced else { return Frame::Bad };
    let Some(TransportSlice::Udp(udp)) = sliced.transport else {
        return if sliced.stop_err.is_some() { Frame::Bad } else { Frame::Other };
    };
    let claimed = usize::from(udp.length()).saturating_sub(8);
    let payload = udp.payload();
    if payload.len() < claimed { Frame::Bad } else { Frame::Udp(payload) }
}

/// Linux "cooked" frames: a header of `header` bytes with the ether type at `ether_type`.
fn cooked(frame: &[u8], ether_type: usize, header: usize) -> Option<LaxSlicedPacket<'_>> {
    let kind = frame.get(ether_type..ether_type + 2)?;
    let kind = EtherType(u16::from_be_bytes([kind[0], kind[1]]));
    Some(LaxSlicedPacket::from_ether_type(kind, frame.get(header..)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use etherparse::PacketBuilder;

    fn ip(payload: &[u8]) -> Vec<u8> {
        let builder = PacketBuilder::ipv4([192, 168, 1, 201], [255; 4], 64).udp(443, 2368);
        let mut bytes = Vec::new();
        builder.write(&mut bytes, payload).unwrap();
        bytes
    }

    fn framed(header: &[u8], payload: &[u8]) -> Vec<u8> {
        [header, &ip(payload)].concat()
    }

    #[test]
    fn every_link_type_gives_the_same_payload() {
        let payload: Vec<u8> = (0..206).map(|i| i as u8).collect();
        let mac = [2_u8; 12];
        let ethernet = [&mac[..], &[0x08, 0x00]].concat();
        let vlan = [&mac[..], &[0x81, 0x00, 0, 5, 0x08, 0x00]].concat();
        let two_vlans = [&mac[..], &[0x88, 0xa8, 0, 5, 0x81, 0x00, 0, 6, 0x08, 0x00]].concat();
        let sll = [&[0_u8; 14][..], &[0x08, 0x00]].concat();
        let sll2 = [&[0x08, 0x00][..], &[0; 18]].concat();
        let cases: [(i32, &[u8]); 8] = [
            (ETHERNET, &ethernet),
            (ETHERNET, &vlan),
            (ETHERNET, &two_vlans),
            (NULL, &[2, 0, 0, 0]),
            (RAW, &[]),
            (12, &[]),
            (LINUX_SLL, &sll),
            (LINUX_SLL2, &sll2),
        ];
        for (link, header) in cases {
            assert_eq!(parse(link, &framed(header, &payload)), Frame::Udp(&payload), "link type {link}");
        }
    }

    #[test]
    fn ipv6_and_ip_options_are_stepped_over() {
        let mut v6 = Vec::new();
        PacketBuilder::ipv6([1; 16], [2; 16], 9).udp(1, 2).write(&mut v6, &[7; 40]).unwrap();
        assert_eq!(parse(RAW, &v6), Frame::Udp(&[7; 40]));

        let mut options = ip(&[7; 40]);
        options[0] = 0x46; // six words of header
        let total = (options.len() + 4) as u16;
        options[2..4].copy_from_slice(&total.to_be_bytes());
        options.splice(20..20, [1, 1, 1, 0]);
        assert_eq!(parse(RAW, &options), Frame::Udp(&[7; 40]));
    }

    #[test]
    fn trailing_bytes_of_the_link_layer_are_no_payload() {
        let mut frame = framed(&[&[2_u8; 12][..], &[0x08, 0x00]].concat(), &[9; 30]);
        frame.extend_from_slice(&[0xAA; 6]);
        assert_eq!(parse(ETHERNET, &frame), Frame::Udp(&[9; 30]));
    }

    #[test]
    fn what_is_not_udp_is_none_of_ours_and_what_is_cut_off_is_bad() {
        let arp = [&[2_u8; 12][..], &[0x08, 0x06], &[0; 28]].concat();
        assert_eq!(parse(ETHERNET, &arp), Frame::Other);
        let mut tcp = Vec::new();
        PacketBuilder::ipv4([1; 4], [2; 4], 9).tcp(1, 2, 3, 4).write(&mut tcp, &[0; 10]).unwrap();
        assert_eq!(parse(RAW, &tcp), Frame::Other);
        assert_eq!(parse(147, &ip(&[1; 10])), Frame::Other, "an unknown link type");
        let whole = ip(&[1; 100]);
        for len in 0..whole.len() {
            assert_eq!(parse(RAW, &whole[..len]), Frame::Bad, "cut off after {len} bytes");
        }
        let mut fragment = ip(&[1; 100]);
        fragment[6] = 0x20; // more fragments
        assert!(!matches!(parse(RAW, &fragment), Frame::Udp(_)));
    }
}

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;

const SCHEME: &str = "udp://";
const ANY: &str = "any";

/// Where a live sensor's packets arrive and who may send them: `udp://SENDER@ADDR:PORT`.
///
/// ADDR is an address of this machine, `0.0.0.0` or `[::]` for all of them (which broadcasts need, a sensor's factory
/// setting), or a multicast group; IPv6 addresses stand in brackets. SENDER is the sensor's address, or `any`. It may be
/// left out where ADDR is a loopback address: then this machine is the only sender.
///
/// ```
/// use replay::LiveAddress;
/// let live: LiveAddress = "udp://192.168.1.201@0.0.0.0:2368".parse().unwrap();
/// assert!(live.accepts("192.168.1.201".parse().unwrap()));
/// assert!(!live.accepts("192.168.1.202".parse().unwrap()));
/// assert!("udp://127.0.0.1:2368".parse::<LiveAddress>().is_ok());
/// assert!("udp://0.0.0.0:2368".parse::<LiveAddress>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveAddress {
    listen: SocketAddr,
    senders: Senders,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Senders {
    Any,
    Loopback,
    One(IpAddr),
}

/// Why a live sensor's address is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LiveAddressError {
    /// It is not of the form.
    #[error("{0}: must be udp://SENDER@ADDR:PORT, as in udp://192.168.1.201@0.0.0.0:2368")]
    Form(String),
    /// Others than this machine can send to it, and no sender is named.
    #[error(
        "{0}: names no sender; write the sensor's address before it, as in udp://192.168.1.201@0.0.0.0:2368, or any@ to take packets of everyone"
    )]
    NoSender(String),
}

impl LiveAddress {
    /// Whether `from` is a live sensor's address and not a file.
    pub fn is_one(from: &str) -> bool {
        from.starts_with(SCHEME)
    }

    /// Address and port of this machine, or a multicast group, at which packets arrive.
    pub fn listen(&self) -> SocketAddr {
        self.listen
    }

    /// Whether packets of `sender` are taken.
    pub fn accepts(&self, sender: IpAddr) -> bool {
        // An IPv4 sender reaches an IPv6 socket under a mapped address.
        let sender = sender.to_canonical();
        match self.senders {
            Senders::Any => true,
            Senders::Loopback => sender.is_loopback(),
            Senders::One(one) => sender == one,
        }
    }
}

impl FromStr for LiveAddress {
    type Err = LiveAddressError;

    fn from_str(text: &str) -> Result<Self, LiveAddressError> {
        let form = || LiveAddressError::Form(text.to_owned());
        let rest = text.strip_prefix(SCHEME).ok_or_else(form)?;
        let (sender, listen) = match rest.split_once('@') {
            Some((sender, listen)) => (Some(sender), listen),
            None => (None, rest),
        };
        let listen: SocketAddr = listen.parse().map_err(|_| form())?;
        let senders = match sender {
            Some(ANY) => Senders::Any,
            Some(sender) => {
                let bare = sender.strip_prefix('[').and_then(|sender| sender.strip_suffix(']')).unwrap_or(sender);
                Senders::One(bare.parse::<IpAddr>().map_err(|_| form())?.to_canonical())
            }
            None if listen.ip().is_loopback() => Senders::Loopback,
            None => return Err(LiveAddressError::NoSender(text.to_owned())),
        };
        Ok(Self { listen, senders })
    }
}

impl fmt::Display for LiveAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(SCHEME)?;
        match self.senders {
            Senders::Any => write!(f, "{ANY}@")?,
            Senders::One(IpAddr::V4(one)) => write!(f, "{one}@")?,
            Senders::One(IpAddr::V6(one)) => write!(f, "[{one}]@")?,
            Senders::Loopback => {}
        }
        write!(f, "{}", self.listen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_reads_back_as_written_and_says_who_may_send() {
        let ip = |text: &str| text.parse::<IpAddr>().unwrap();
        for (text, mine, others) in [
            ("udp://127.0.0.1:2368", "127.0.0.1", "10.0.0.1"),
            ("udp://[::1]:2368", "::1", "fe80::1"),
            ("udp://10.0.0.2@0.0.0.0:2368", "10.0.0.2", "127.0.0.1"),
            ("udp://10.0.0.2@[::]:2368", "::ffff:10.0.0.2", "10.0.0.3"),
            ("udp://[fe80::1]@[::]:2368", "fe80::1", "10.0.0.1"),
            ("udp://10.0.0.2@239.1.2.3:2368", "10.0.0.2", "10.0.0.3"),
        ] {
            let sut: LiveAddress = text.parse().unwrap();
            assert_eq!(sut.to_string(), text);
            assert!(sut.accepts(ip(mine)) && !sut.accepts(ip(others)), "{text}");
        }
        assert!("udp://any@0.0.0.0:2368".parse::<LiveAddress>().unwrap().accepts(ip("8.8.8.8")));
    }

    #[test]
    fn what_is_no_address_or_open_to_everyone_by_mistake_is_refused() {
        for text in
            ["udp://", "udp://2368", "udp://localhost:2368", "udp://1.2.3.4", "udp://@1.2.3.4:5", "tcp://1.2.3.4:5"]
        {
            assert_eq!(text.parse::<LiveAddress>(), Err(LiveAddressError::Form(text.to_owned())));
        }
        for text in ["udp://0.0.0.0:2368", "udp://192.168.1.77:2368", "udp://[::]:2368", "udp://239.1.2.3:2368"] {
            assert_eq!(text.parse::<LiveAddress>(), Err(LiveAddressError::NoSender(text.to_owned())));
        }
    }
}

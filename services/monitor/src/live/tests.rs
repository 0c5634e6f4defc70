use std::net::TcpStream;
use std::thread::{self, JoinHandle};

use tape::Topic;
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};

use super::protocol::{SUBPROTOCOLS, place};
use super::server::Server;

/// Another thread for a client, which blocks.
fn aside<T: Send + 'static>(what: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    thread::Builder::new().spawn(what).unwrap()
}

type Viewer = WebSocket<MaybeTlsStream<TcpStream>>;

fn sut() -> Server {
    Server::listen("127.0.0.1", 0, "encke sut", "1").unwrap()
}

/// Lets the server turn until the other thread has ended.
fn serve<T>(server: &mut Server, other: JoinHandle<T>) -> T {
    while !other.is_finished() {
        server.wait(1_000_000);
        server.turn();
    }
    server.turn();
    other.join().unwrap()
}

fn connecting(server: &Server, protocol: &'static str) -> JoinHandle<Result<Viewer, Box<tungstenite::Error>>> {
    let address = format!("ws://{}", server.address());
    aside(move || {
        let mut request = address.into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
        Ok(connect(request).map_err(Box::new)?.0)
    })
}

/// A viewer that has subscribed to a topic under number 7.
fn viewer(server: &mut Server, topic: Topic) -> Viewer {
    let connecting = connecting(server, SUBPROTOCOLS[0]);
    let mut viewer = serve(server, connecting).unwrap();
    let channel = place(topic) + 1;
    let words = format!(r#"{{"op":"subscribe","subscriptions":[{{"id":7,"channelId":{channel}}}]}}"#);
    viewer.send(Message::text(words)).unwrap();
    while !server.wants(topic) {
        server.wait(1_000_000);
        server.turn();
    }
    viewer
}

/// Offers so many megabytes, one a message; how many of them were encoded.
fn offer(server: &mut Server, topic: Topic, messages: u64) -> u64 {
    let mut encoded = 0;
    for time_ns in 0..messages {
        server.offer(topic, time_ns, |out| {
            out.resize(1 << 20, 1);
            encoded += 1;
            true
        });
        server.turn();
    }
    encoded
}

#[test]
fn a_viewer_is_told_what_there_is_and_gets_what_it_asked_for() {
    let mut sut = sut();
    let mut viewer = viewer(&mut sut, Topic::Detections);
    sut.offer(Topic::Detections, 42, |out| {
        out.extend_from_slice(b"obstacles");
        true
    });
    sut.offer(Topic::Sweep, 42, |_| panic!("nobody asked for it"));
    let reading = aside(move || [(); 3].map(|()| viewer.read().unwrap()));
    let [info, channels, data] = serve(&mut sut, reading);
    assert!(info.to_text().unwrap().contains("encke sut"));
    assert!(channels.to_text().unwrap().contains("/encke/detections"));
    assert_eq!(&data.into_data()[..], b"\x01\x07\0\0\0\x2a\0\0\0\0\0\0\0obstacles");
    assert_eq!(sut.account().topics[place(Topic::Detections)].sent, 1);
}

#[test]
fn nothing_is_encoded_for_nobody() {
    let mut sut = sut();
    assert_eq!(offer(&mut sut, Topic::Sweep, 3), 0);
    let connecting = connecting(&sut, SUBPROTOCOLS[1]);
    let _viewer = serve(&mut sut, connecting).unwrap();
    assert!(!sut.wants(Topic::Sweep));
    assert_eq!(offer(&mut sut, Topic::Sweep, 3), 0);
    assert_eq!((sut.account().clients, sut.clients()), (1, 1));
}

#[test]
fn a_frozen_viewer_is_not_waited_for_and_all_that_it_did_not_get_is_counted() {
    const OFFERED: u64 = 200;
    let mut sut = sut();
    let frozen = viewer(&mut sut, Topic::Sweep);
    let encoded = offer(&mut sut, Topic::Sweep, OFFERED);
    let counts = sut.account().topics[place(Topic::Sweep)].clone();
    assert!(counts.behind > OFFERED / 2, "{counts:?}");
    assert_eq!(encoded, OFFERED - counts.behind, "what cannot be sent is not encoded");
    assert!(!sut.wants(Topic::Sweep), "nor are sweeps joined for it");
    assert!(encoded - counts.sent <= 1, "one message waits at most: {counts:?}");

    drop(frozen);
    while sut.clients() > 0 {
        sut.wait(1_000_000);
        sut.turn();
    }
    let counts = sut.account().topics[place(Topic::Sweep)].clone();
    assert_eq!(counts.sent + counts.behind + counts.incomplete + counts.undelivered, OFFERED, "{counts:?}");
}

#[test]
fn a_viewer_that_reads_again_gets_what_comes_then() {
    let mut sut = sut();
    let mut viewer = viewer(&mut sut, Topic::Sweep);
    offer(&mut sut, Topic::Sweep, 100);
    let reading = aside(move || {
        loop {
            let data = viewer.read().unwrap().into_data();
            if data.len() < 100 && data.first() == Some(&1) {
                return data;
            }
        }
    });
    while !sut.wants(Topic::Sweep) {
        sut.wait(1_000_000);
        sut.turn();
    }
    sut.offer(Topic::Sweep, 1_000, |out| {
        out.push(9);
        true
    });
    assert_eq!(serve(&mut sut, reading).last(), Some(&9));
}

#[test]
fn a_sweep_that_is_not_whole_is_counted_and_not_sent() {
    let mut sut = sut();
    let _viewer = viewer(&mut sut, Topic::Clusters);
    sut.skip(Topic::Clusters);
    sut.offer(Topic::Clusters, 0, |_| false);
    assert_eq!(sut.account().topics[place(Topic::Clusters)].incomplete, 2);
    assert_eq!(sut.account().topics[place(Topic::Sweep)].incomplete, 0, "nobody asked for it");
}

#[test]
fn who_speaks_another_protocol_is_refused() {
    let mut sut = sut();
    let connecting = connecting(&sut, "chat");
    assert!(serve(&mut sut, connecting).is_err());
    let account = sut.account();
    assert_eq!((account.clients, account.refused), (0, 1));
}

#[test]
fn another_life_of_the_chain_is_another_session() {
    let mut sut = sut();
    let mut viewer = viewer(&mut sut, Topic::Sweep);
    sut.renew("encke sut", "2");
    let reading = aside(move || [(); 4].map(|()| viewer.read().unwrap()));
    let [before, _, after, _] = serve(&mut sut, reading);
    assert!(before.to_text().unwrap().contains(r#""sessionId":"1""#));
    assert!(after.to_text().unwrap().contains(r#""sessionId":"2""#));
}

#[test]
fn an_address_that_is_taken_is_refused_by_name() {
    let sut = sut();
    let (bind, port) = sut.address().rsplit_once(':').map(|(a, b)| (a.to_owned(), b.parse().unwrap())).unwrap();
    let refused = Server::listen(&bind, port, "", "").err().unwrap().to_string();
    assert!(refused.starts_with(&format!("{bind}:{port}: ")) && refused.contains("--port"), "{refused}");
    assert!(sut.is_local());
}

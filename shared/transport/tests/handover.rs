//! One process, real shared memory: what is written at one end is read at the other.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use messages::{Message, Sweep, Truth};
use transport::{Instance, Node};

const CONFIG: &str = include_str!("../../../config/iceoryx2.toml");

struct Running(Instance);

impl Running {
    fn start(name: &str) -> (Self, Node) {
        let instance = Instance::named(&format!("{name}-{}", std::process::id())).unwrap();
        instance.make_private_dir().unwrap();
        instance.write_config(CONFIG, 1).unwrap();
        let node = Node::join(&instance, "test", 4).unwrap();
        (Self(instance), node)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.0.remove().unwrap();
    }
}

// One test: iceoryx2's global configuration belongs to a process, so two instances do not fit in one.
#[test]
fn messages_arrive_in_order_and_the_oldest_yields_to_the_newest() {
    let (running, node) = Running::start("handover");
    let hold = node.create::<Sweep>().unwrap();
    let outlet = node.outlet::<Sweep>().unwrap();
    let inlet = node.inlet::<Sweep>().unwrap();
    assert!(inlet.take().unwrap().is_none());

    let send = |ordinal: u64| {
        let mut loan = outlet.loan().unwrap();
        assert!(loan.message_mut().returns.is_empty(), "a loan arrives empty");
        let made = lidar_return(ordinal);
        loan.message_mut().returns.push(made).unwrap();
        loan.trace_mut().part.ordinal = ordinal;
        loan.send().unwrap();
    };
    for ordinal in 0..3 {
        send(ordinal);
    }
    inlet.wait(Duration::from_secs(5)).unwrap();
    for ordinal in 0..3 {
        let taken = inlet.take().unwrap().unwrap();
        assert_eq!(taken.trace().part.ordinal, ordinal);
        assert_eq!(taken.message().returns[..], [lidar_return(ordinal)]);
    }
    assert!(inlet.take().unwrap().is_none());

    for ordinal in 3..10 {
        send(ordinal);
    }
    let kept: Vec<u64> = std::iter::from_fn(|| inlet.take().unwrap()).map(|t| t.trace().part.ordinal).collect();
    assert_eq!(kept, [6, 7, 8, 9], "a queue of four keeps the newest four");

    for ordinal in 10..13 {
        send(ordinal);
    }
    assert!(inlet.take().unwrap().is_some());
    let viewer = Node::visit(&running.0, "viewer", 4).unwrap();
    let taps = [viewer.tap::<Sweep>().unwrap(), viewer.tap::<Sweep>().unwrap(), viewer.tap::<Sweep>().unwrap()];
    let refused = viewer.tap::<Sweep>().err().unwrap().to_string();
    assert!(refused.contains("3 are attached beside the next stage already"), "{refused}");
    for ordinal in 13..20 {
        send(ordinal);
    }
    for tap in &taps {
        let seen: Vec<u64> = std::iter::from_fn(|| tap.take().unwrap()).map(|t| t.trace().part.ordinal).collect();
        assert_eq!(seen, [16, 17, 18, 19], "a tap sees the newest of what came after it, whoever else reads");
    }
    drop((taps, viewer));

    let missing = node.outlet::<Truth>().err().unwrap();
    assert!(missing.to_string().contains(Truth::TYPE), "{missing}");
    assert!(running.0.shared_memory().len() > 1);
    drop((inlet, outlet, hold, node));
    let left = running.0.shared_memory();
    assert!(
        left.iter().all(|name| name.ends_with(".global_mgmt")),
        "an orderly end leaves no message behind: {left:?}"
    );
    running.0.remove().unwrap();
    assert_eq!(running.0.shared_memory(), Vec::<String>::new());
    assert!(!running.0.dir().exists());
}

fn lidar_return(ordinal: u64) -> lidar::Return {
    lidar::Return { x: ordinal as f32, ..Default::default() }
}

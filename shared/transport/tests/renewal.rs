//! What somebody deletes in shared memory is made anew in the same processes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;
use std::path::Path;

use messages::Sweep;
use transport::{Inlet, Instance, Node, Outlet};

const CONFIG: &str = include_str!("../../../config/iceoryx2.toml");

struct Running(Instance);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.remove().unwrap();
    }
}

fn send(outlet: &Outlet<Sweep>, ordinal: u64) {
    let mut loan = outlet.loan().unwrap();
    loan.trace_mut().part.ordinal = ordinal;
    loan.send().unwrap();
}

fn read(inlet: &Inlet<Sweep>) -> Vec<u64> {
    std::iter::from_fn(|| inlet.take().unwrap()).map(|taken| taken.trace().part.ordinal).collect()
}

// One test: iceoryx2's global configuration belongs to a process, so two instances do not fit in one.
#[test]
fn a_service_whose_files_are_gone_is_drained_and_created_anew_whoever_still_looks_at_the_old_one() {
    let running = Running(Instance::named(&format!("renewal-{}", std::process::id())).unwrap());
    let instance = &running.0;
    instance.make_private_dir().unwrap();
    instance.write_config(CONFIG, 1).unwrap();
    let node = Node::join(instance, "test", 4).unwrap();
    let hold = node.create::<Sweep>().unwrap();
    let (outlet, inlet) = (node.outlet::<Sweep>().unwrap(), node.inlet::<Sweep>().unwrap());
    let viewer = Node::visit(instance, "viewer", 4).unwrap();
    let tap = viewer.tap::<Sweep>().unwrap();
    send(&outlet, 0);
    for name in instance.shared_memory() {
        fs::remove_file(Path::new("/dev/shm").join(name)).unwrap();
    }

    send(&outlet, 1);
    assert_eq!(read(&inlet), [0, 1], "what is mapped goes on");
    assert!(node.create::<Sweep>().is_err(), "the name is taken by what nobody can join");
    let of_before = instance.shared_memory();

    assert!(!viewer.is_left_behind());
    instance.write_config(CONFIG, "1-2").unwrap();
    assert!(viewer.is_left_behind());
    let renewed = Node::join_anew(instance, "test", 4).unwrap();
    let _renewed_hold = renewed.create::<Sweep>().unwrap();
    drop((inlet, outlet, hold, node));
    instance.remove_from_shared_memory(&of_before).unwrap();
    let (outlet, inlet) = (renewed.outlet::<Sweep>().unwrap(), renewed.inlet::<Sweep>().unwrap());
    send(&outlet, 2);
    assert_eq!(read(&inlet), [2]);
    assert_eq!(tap.take().unwrap().map(|taken| taken.trace().part.ordinal), Some(0));
    let late = Node::visit(instance, "late", 4).unwrap();
    assert!(!late.is_left_behind());
    let late_tap = late.tap::<Sweep>().unwrap();
    send(&outlet, 3);
    assert_eq!(late_tap.take().unwrap().map(|taken| taken.trace().part.ordinal), Some(3));
    drop((tap, viewer));
    send(&outlet, 4);
    assert_eq!(read(&inlet), [3, 4], "who leaves the old one takes nothing of the new one along");
}

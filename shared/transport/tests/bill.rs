//! The bill for shared memory is what iceoryx2 lays out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;
use std::path::Path;

use messages::{Clusters, Detections, Message, Sweep};
use transport::{Instance, Node, Segment};

const CONFIG: &str = include_str!("../../../config/iceoryx2.toml");

const QUEUE_PARTS: usize = 8;

struct Running(Instance);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.remove().unwrap();
    }
}

/// Length of the longest shared memory file that opening the writing end adds: the data segment.
fn segment_file<T: Message>(instance: &Instance, node: &Node) -> u64 {
    let _service = node.create::<T>().unwrap();
    let before = instance.shared_memory();
    let _outlet = node.outlet::<T>().unwrap();
    let new = instance.shared_memory().into_iter().filter(|name| !before.contains(name));
    new.map(|name| fs::metadata(Path::new("/dev/shm").join(name)).unwrap().len()).max().unwrap()
}

// One test: iceoryx2's global configuration belongs to a process, so two instances do not fit in one.
#[test]
fn the_bill_is_the_length_of_the_files() {
    let running = Running(Instance::named(&format!("bill-{}", std::process::id())).unwrap());
    running.0.make_private_dir().unwrap();
    running.0.write_config(CONFIG, 1).unwrap();
    let node = Node::join(&running.0, "bill", QUEUE_PARTS).unwrap();
    let bills = [
        (Segment::of::<Sweep>(QUEUE_PARTS), segment_file::<Sweep>(&running.0, &node)),
        (Segment::of::<Clusters>(QUEUE_PARTS), segment_file::<Clusters>(&running.0, &node)),
        (Segment::of::<Detections>(QUEUE_PARTS), segment_file::<Detections>(&running.0, &node)),
    ];
    for (segment, found) in bills {
        let billed = segment.virtual_bytes();
        // iceoryx2 adds a list of free places and rounds up to a memory page.
        assert!((billed..billed + billed / 100 + 65_536).contains(&found), "{billed} billed, {found} found");
        assert!(segment.touched_bytes() < billed);
    }
}

//! Other programs on the same machine. Each worker is a process of its own that ends with its time, or with whoever started
//! it.

use std::fs::{File, OpenOptions};
use std::hint::black_box;
use std::io::{Seek, Write};
use std::process::{Child, Command, Stdio};

use faults::{Fault, Planned};
use runtime::clock;
use rustix::process::{Signal, set_parent_process_death_signal};

use crate::Failure;

/// Bytes that are copied, and written: more than any cache holds.
const COPIED: usize = 32 << 20;
const WRITTEN: usize = 4 << 20;
/// A file is begun anew after so many blocks.
const BLOCKS: u64 = 32;

/// Starts the workers and waits for them.
pub(super) fn run(planned: &Planned) -> Result<(), Failure> {
    let workers = planned.argument.unwrap_or(1.0) as usize;
    let started: Result<Vec<Child>, _> = (0..workers).map(|_| start(planned)).collect();
    let mut started = started.map_err(|cause| Failure::run(format!("{}: {cause}", planned.fault.name())))?;
    for worker in &mut started {
        let ended = worker.wait().map_err(Failure::run)?;
        if !ended.success() {
            return Err(Failure::run(format!("a worker of {} ended: {ended}", planned.fault.name())));
        }
    }
    Ok(())
}

fn start(planned: &Planned) -> std::io::Result<Child> {
    let mut command = Command::new("/proc/self/exe");
    command.arg("inject").args(planned.command_line()).arg("--as-worker");
    command.stdin(Stdio::null()).spawn()
}

/// Is one worker.
pub(super) fn work(planned: &Planned) -> Result<(), Failure> {
    set_parent_process_death_signal(Some(Signal::KILL)).map_err(Failure::run)?;
    let end_ns = clock::now_ns() + (planned.for_s.unwrap_or(1.0) * 1e9) as u64;
    let goes_on = || clock::now_ns() < end_ns;
    match planned.fault {
        Fault::CpuHog => while black_box(goes_on()) {},
        Fault::MemoryHog => {
            let (from, mut to) = (vec![1_u8; COPIED], vec![0; COPIED]);
            while goes_on() {
                to.copy_from_slice(black_box(&from));
                black_box(&mut to);
            }
        }
        Fault::IoHog => return write(goes_on).map_err(|cause| Failure::run(format!("io-hog: {cause}"))),
        fault => return Err(Failure::start(format!("{} has no workers", fault.name()))),
    }
    Ok(())
}

/// Writes a file that has no name, and waits for the disk after each block.
fn write(goes_on: impl Fn() -> bool) -> std::io::Result<()> {
    let block = vec![0x5A_u8; WRITTEN];
    let path = std::env::temp_dir().join(format!("encke-io-hog-{}", std::process::id()));
    let mut file: File = OpenOptions::new().write(true).create_new(true).open(&path)?;
    std::fs::remove_file(&path)?;
    let mut blocks = 0;
    while goes_on() {
        if blocks % BLOCKS == 0 {
            file.rewind()?;
        }
        file.write_all(&block)?;
        file.sync_data()?;
        blocks += 1;
    }
    Ok(())
}

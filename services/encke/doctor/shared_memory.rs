//! The bill for shared memory, hop by hop, and what there is to pay it with.

use std::path::Path;

use chain::Chain;
use runtime::SOURCE;
use runtime::realtime::segment_of;
use rustix::fs::{Access, access, statvfs};
use serde::Serialize;

use super::{Check, line_of};

const SHARED_MEMORY: &str = "/dev/shm";
const MIB: f64 = 1_048_576.0;
/// Users below this number are the system's (login.defs(5)).
const FIRST_PERSON: u32 = 1000;

/// What one writer lays out.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct HopBill {
    writer: String,
    message: String,
    /// Places for messages, and the size of one [bytes].
    slots: u64,
    slot_bytes: u64,
    /// Length of the sparse file, mapped by writer and reader [bytes].
    virtual_bytes: u64,
    /// Memory in use when every place that the reader needs was once filled to the brim [bytes].
    touched_bytes: u64,
}

/// The bill of a chain. Truth is written beside the sweeps.
pub(super) fn bill(chain: &Chain) -> Vec<HopBill> {
    let of_source = [(SOURCE, "Sweep"), (SOURCE, "Truth")].into_iter();
    let of_stages = chain.stages.iter().filter_map(|stage| Some((stage.name.as_str(), stage.writes.as_deref()?)));
    let bills = of_source.chain(of_stages).filter_map(|(writer, message)| {
        let segment = segment_of(message, chain.queue_parts())?;
        Some(HopBill {
            writer: writer.to_owned(),
            message: message.to_owned(),
            slots: segment.slots,
            slot_bytes: segment.slot_bytes,
            virtual_bytes: segment.virtual_bytes(),
            touched_bytes: segment.touched_bytes(),
        })
    });
    bills.collect()
}

pub(super) fn checks(bill: &[HopBill]) -> Vec<Check> {
    vec![space(bill), removal()]
}

fn space(bill: &[HopBill]) -> Check {
    let name = "shared memory";
    let (billed, touched) = totals(bill);
    let writable = access(SHARED_MEMORY, Access::WRITE_OK | Access::EXEC_OK);
    let space = match (writable, statvfs(SHARED_MEMORY)) {
        (Ok(()), Ok(space)) => space,
        (Err(cause), _) | (_, Err(cause)) => {
            return Check::fail(name, format!("{SHARED_MEMORY}: {cause}"), "mount a tmpfs there, mode 1777");
        }
    };
    let (size, free) = (space.f_blocks * space.f_frsize, space.f_bavail * space.f_frsize);
    let found = format!(
        "{SHARED_MEMORY} {:.0} MiB, {:.0} free; the chain lays out {:.0} MiB, sparse, and uses {:.0} at most",
        size as f64 / MIB,
        free as f64 / MIB,
        billed as f64 / MIB,
        touched as f64 / MIB
    );
    let need = (touched as f64 / MIB * 1.5).ceil();
    let remedy = format!("`mount -o remount,size={need}m {SHARED_MEMORY}` (a container: `--shm-size={need}m`)");
    if free < touched { Check::fail(name, found, remedy) } else { Check::ok(name, found) }
}

/// logind can delete a user's shared memory when he logs out.
fn removal() -> Check {
    let name = "RemoveIPC";
    let uid = rustix::process::getuid().as_raw();
    if !Path::new("/run/systemd/system").exists() {
        return Check::ok(name, "no systemd is running");
    }
    if uid < FIRST_PERSON {
        return Check::ok(name, format!("uid {uid} is the system's, logind leaves its shared memory alone"));
    }
    let text = line_of("/etc/systemd/logind.conf").unwrap_or_default();
    let set = text.lines().filter_map(|line| line.trim().strip_prefix("RemoveIPC=")).next_back();
    let keeps = set.is_some_and(|value| ["no", "false", "0", "off"].contains(&value.trim()));
    let found = format!("{} in /etc/systemd/logind.conf", set.unwrap_or("not set, so yes,"));
    let remedy = "`RemoveIPC=no` there, or run as a system user: else a chain dies when its user logs out";
    Check::ok_if(keeps, name, found, remedy)
}

fn totals(bill: &[HopBill]) -> (u64, u64) {
    bill.iter().fold((0, 0), |(billed, touched), hop| (billed + hop.virtual_bytes, touched + hop.touched_bytes))
}

/// The bill for people.
pub(super) fn table(bill: &[HopBill]) -> String {
    let mut text = "\nshared memory [MiB]          places   of  laid out   in use at most\n".to_owned();
    let row = |name: &str, slots: String, slot: String, billed: u64, touched: u64| {
        let (billed, touched) = (billed as f64 / MIB, touched as f64 / MIB);
        format!("  {name:<26}{slots:>7}{slot:>7}{billed:>8.1}{touched:>17.1}\n")
    };
    for hop in bill {
        let name = format!("{} by {}", hop.message, hop.writer);
        let slot = format!("{:.2}", hop.slot_bytes as f64 / MIB);
        text += &row(&name, hop.slots.to_string(), slot, hop.virtual_bytes, hop.touched_bytes);
    }
    let (billed, touched) = totals(bill);
    text + &row("all", String::new(), String::new(), billed, touched)
}

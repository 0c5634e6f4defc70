//! Faults that are signals.

use faults::{Fault, shuffled};
use runtime::Plan;
use runtime::page::PageMap;
use rustix::process::{Pid, Signal, kill_process};

use super::Injection;
use crate::Failure;

impl Injection {
    pub(super) fn signal(&self) -> Result<(), Failure> {
        match self.planned.fault {
            Fault::KillSupervisor => send("the supervisor", self.supervisor(), Signal::KILL),
            Fault::KillAll => self.kill_all(),
            Fault::Stop => {
                let stopped = self.process()?;
                send(self.stage(), Some(stopped), Signal::STOP)?;
                self.wait();
                // It may have been ended meanwhile, because it stood still.
                if self.process().ok() == Some(stopped) {
                    send(self.stage(), Some(stopped), Signal::CONT)
                } else {
                    Ok(())
                }
            }
            _ => self.kill(),
        }
    }

    /// Ends the stage at once.
    pub(super) fn kill(&self) -> Result<(), Failure> {
        send(self.stage(), Some(self.process()?), Signal::KILL)
    }

    /// The process of the stage that is meant.
    pub(super) fn process(&self) -> Result<Pid, Failure> {
        let pid = supervisor::stage_process(&self.instance, &*self.page()?);
        pid.ok_or_else(|| Failure::run(format!("stage {:?} has no process", self.stage())))
    }

    fn supervisor(&self) -> Option<Pid> {
        Pid::from_raw(self.supervisor as i32)
    }

    /// Ends every process of the chain, the supervisor among them, in an order that the seed decides.
    fn kill_all(&self) -> Result<(), Failure> {
        let names = self.plan.stages().chain(self.plan.tape());
        let pages = names.filter_map(|name| PageMap::open(&Plan::page_path(&self.instance, name)).ok());
        let mut all: Vec<Pid> = pages.filter_map(|page| supervisor::stage_process(&self.instance, &page)).collect();
        all.extend(self.supervisor());
        for place in shuffled(all.len(), self.planned.seed) {
            // One may have gone with those before.
            let _ = kill_process(all[place], Signal::KILL);
        }
        Ok(())
    }
}

fn send(name: &str, pid: Option<Pid>, signal: Signal) -> Result<(), Failure> {
    let pid = pid.ok_or_else(|| Failure::run(format!("{name} has no process")))?;
    kill_process(pid, signal).map_err(|cause| Failure::run(format!("{name}: {cause}")))
}

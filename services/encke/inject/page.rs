//! Faults that a stage has itself: asked for on its page.

use faults::{FOR_EVER, Fault};
use runtime::Plan;
use runtime::faults::{Asked, STORM_PER_S};
use runtime::page::PageMap;

use super::Injection;
use crate::Failure;

impl Injection {
    /// The page of the stage that is meant.
    pub(super) fn page(&self) -> Result<PageMap, Failure> {
        PageMap::open(&Plan::page_path(&self.instance, self.stage())).map_err(Failure::start)
    }

    /// Asks the stage for the fault; takes it back where it lasts for a time that the stage does not count itself.
    pub(super) fn ask_on_page(&self) -> Result<(), Failure> {
        let page = self.page()?;
        let Some(number) = self.planned.fault.page_number() else {
            return Err(Failure::run(format!("{} is not asked for on a page", self.planned.fault.name())));
        };
        let times = match self.planned.fault {
            Fault::EventStorm => (self.planned.for_s.unwrap_or(1.0) * STORM_PER_S as f64) as u64,
            // Until it is taken back.
            Fault::SlowTimes => FOR_EVER,
            _ => self.planned.times.unwrap_or(1),
        };
        page.ask_for(Asked { number, by: self.by() as i32, seed: self.planned.seed as u32, times });
        if self.planned.fault == Fault::SlowTimes && self.planned.for_s.is_some() {
            self.wait();
            page.ask_for_none();
        }
        Ok(())
    }

    /// The two that have a word of their own.
    pub(super) fn by_word(&self) -> Result<(), Failure> {
        let page = self.page()?;
        if self.planned.fault == Fault::Swallow {
            page.swallow.give(self.planned.times.unwrap_or(1));
            return Ok(());
        }
        page.slow_ns.set((self.planned.argument.unwrap_or(0.0) * 1e6) as u64);
        if self.planned.for_s.is_some() {
            self.wait();
            page.slow_ns.set(0);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use faults::CATALOGUE;
    use runtime::faults::{FIRST_OF_SWEEPS, ShellFault};

    #[test]
    fn the_shell_and_the_catalogue_give_the_same_faults_the_same_numbers() {
        let asked = CATALOGUE.iter().filter_map(|entry| entry.fault.page_number());
        let of_shell: Vec<u64> = asked.clone().filter(|number| *number < FIRST_OF_SWEEPS).collect();
        assert_eq!(of_shell, ShellFault::ALL.map(|fault| fault as u64));
        let of_sweeps: Vec<u64> = asked.filter(|number| *number >= FIRST_OF_SWEEPS).collect();
        let named = CATALOGUE.iter().filter(|entry| entry.fault.is_of_sweeps()).map(|entry| entry.fault as u64);
        assert_eq!(of_sweeps, named.collect::<Vec<_>>());
    }
}

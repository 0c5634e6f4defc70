use serde::{Deserialize, Serialize};

use crate::statistics::Slope;

use super::Use;

/// Memory's growth counts from this age of a process on [s].
pub(crate) const SETTLE_S: f64 = 300.0;
/// Fewest stretches after that, to say anything of growth.
const LEAST_STRETCHES: usize = 4;
/// Most stretches that are kept of a life: two weeks of minutes.
const MOST_STRETCHES: usize = 20_160;

/// Mean, least and most of a value over a stretch of time.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    t_s: f64,
    sum: f64,
    samples: u32,
    least: u64,
    most: u64,
}

/// A value over time, in stretches of equal length.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    stretch_s: f64,
    stretches: Vec<Stretch>,
}

impl Level {
    /// In stretches of so many seconds.
    pub(crate) fn new(stretch_s: f64) -> Self {
        Self { stretch_s, stretches: Vec::new() }
    }

    /// Adds a sample.
    pub(crate) fn add(&mut self, t_s: f64, value: u64) {
        let begin_s = (t_s / self.stretch_s).floor() * self.stretch_s;
        if self.stretches.last().is_none_or(|last| last.t_s < begin_s) && self.stretches.len() < MOST_STRETCHES {
            self.stretches.push(Stretch { t_s: begin_s, least: value, most: value, ..Stretch::default() });
        }
        if let Some(last) = self.stretches.last_mut().filter(|last| last.t_s == begin_s) {
            last.sum += value as f64;
            last.samples += 1;
            (last.least, last.most) = (last.least.min(value), last.most.max(value));
        }
    }

    /// Whole stretches that begin at `from_s` or later: the first of all is not whole, nor is the last.
    fn whole(&self, from_s: f64) -> &[Stretch] {
        let end = self.stretches.len().saturating_sub(1);
        let begin = self.stretches.iter().position(|stretch| stretch.t_s >= from_s).unwrap_or(end);
        &self.stretches[begin.min(end)..end]
    }

    /// Whether the value stays the same from `from_s` on, by the least of each stretch (what is open for a moment comes and goes):
    /// the first stretch's, the last one's, and the most seen.
    pub(crate) fn steady(&self, from_s: f64) -> Option<Steady> {
        let whole = self.whole(from_s);
        let (first, last) = (whole.first()?, whole.last()?);
        let most = whole.iter().map(|stretch| stretch.most).max()?;
        Some(Steady { first: first.least, last: last.least, most })
    }

    /// Growth from `from_s` on; none where there is too little after that.
    pub(crate) fn growth(&self, from_s: f64) -> Option<Growth> {
        let whole = self.whole(from_s);
        if whole.len() < LEAST_STRETCHES {
            return None;
        }
        let mean = |stretch: &Stretch| stretch.sum / f64::from(stretch.samples.max(1));
        let points: Vec<_> = whole.iter().map(|stretch| (stretch.t_s / 3600.0, mean(stretch))).collect();
        let (first, last) = (points.first()?.1, points.last()?.1);
        let growth_pct = if first > 0.0 { 100.0 * (last - first) / first } else { 0.0 };
        Some(Growth { first, last, growth_pct, per_hour: Slope::of(&points)? })
    }
}

/// A value that should not change.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Steady {
    /// At the begin.
    pub first: u64,
    /// At the end.
    pub last: u64,
    /// The most at any look.
    pub most: u64,
}

/// How memory grew.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Growth {
    /// Mean of the first minute looked at [KiB].
    pub first: f64,
    /// Mean of the last minute [KiB].
    pub last: f64,
    /// From the one to the other [%].
    pub growth_pct: f64,
    /// The slope over the minutes' means [KiB/h].
    pub per_hour: Slope,
}

/// What one stage's processes used over time: of the longest life and of the present one.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub(crate) name: String,
    stretch_s: f64,
    present: Option<Life>,
    longest: Option<Life>,
    pub(crate) lives: u64,
}

#[derive(Clone, Debug)]
struct Life {
    pid: u64,
    from_s: f64,
    until_s: f64,
    rss_kib: Level,
    own_kib: Level,
    files: Level,
    threads: Level,
}

/// What a process used.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ProcessRecord {
    /// The stage, or `supervisor`.
    pub process: String,
    /// Processes that it had.
    pub lives: u64,
    /// Length of the longest life [s]; all that follows is of that.
    pub longest_s: f64,
    /// How memory grew after its first five minutes; null where it did not live for so long.
    pub memory_kib: Option<Growth>,
    /// The same of what is its own: neither shared memory nor files.
    pub own_memory_kib: Option<Growth>,
    /// File descriptors; null where the life was too short.
    pub files: Option<Steady>,
    /// Threads; null where the life was too short.
    pub threads: Option<Steady>,
}

impl Record {
    /// Of a process of this name, in stretches of so many seconds.
    pub(crate) fn new(name: &str, stretch_s: f64) -> Self {
        Self { name: name.to_owned(), stretch_s, present: None, longest: None, lives: 0 }
    }

    /// Adds a sample.
    pub(crate) fn add(&mut self, t_s: f64, used: &Use) {
        if self.present.as_ref().is_none_or(|life| life.pid != used.pid) {
            self.lives += 1;
            let level = || Level::new(self.stretch_s);
            let [rss_kib, own_kib, files, threads] = [level(), level(), level(), level()];
            let life = Life { pid: used.pid, from_s: t_s, until_s: t_s, rss_kib, own_kib, files, threads };
            let before = self.present.replace(life);
            self.keep(before);
        }
        if let Some(life) = &mut self.present {
            life.until_s = t_s;
            life.rss_kib.add(t_s, used.rss_kib);
            life.own_kib.add(t_s, used.own_kib);
            life.files.add(t_s, used.files);
            life.threads.add(t_s, used.threads);
        }
    }

    fn keep(&mut self, life: Option<Life>) {
        let length = |life: &Life| life.until_s - life.from_s;
        let longer = life.filter(|life| self.longest.as_ref().is_none_or(|longest| length(life) > length(longest)));
        self.longest = longer.or_else(|| self.longest.take());
    }

    /// What is to be said; `settle_s` is the age at which descriptors and threads must have come to rest.
    pub(crate) fn report(mut self, settle_s: f64) -> ProcessRecord {
        let present = self.present.take();
        self.keep(present);
        let life = self.longest.as_ref();
        ProcessRecord {
            process: self.name,
            lives: self.lives,
            longest_s: life.map_or(0.0, |life| life.until_s - life.from_s),
            memory_kib: life.and_then(|life| life.rss_kib.growth(life.from_s + SETTLE_S)),
            own_memory_kib: life.and_then(|life| life.own_kib.growth(life.from_s + SETTLE_S)),
            files: life.and_then(|life| life.files.steady(life.from_s + settle_s)),
            threads: life.and_then(|life| life.threads.steady(life.from_s + settle_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(pid: u64, rss_kib: u64, files: u64) -> Use {
        Use { pid, rss_kib, own_kib: rss_kib / 2, files, threads: 2, cpu_s: 0.0 }
    }

    #[test]
    fn growth_counts_after_five_minutes_and_of_the_longest_life() {
        let mut sut = Record::new("clusterer", 60.0);
        for t_s in 0..100 {
            sut.add(f64::from(t_s), &used(1, 5_000, 9));
        }
        for t_s in 100..2_000 {
            // Start-up grows; then it is level.
            let rss = if t_s < 300 { 1_000 + t_s as u64 * 10 } else { 10_000 };
            sut.add(f64::from(t_s), &used(2, rss, 10 + u64::from(t_s % 7 == 0)));
        }
        let report = sut.report(60.0);
        assert_eq!((report.lives, report.longest_s), (2, 1899.0));
        let growth = report.memory_kib.unwrap();
        assert_eq!((growth.growth_pct, growth.per_hour.slope), (0.0, 0.0));
        assert_eq!(report.files, Some(Steady { first: 10, last: 10, most: 11 }));
    }

    #[test]
    fn a_short_life_says_nothing_of_growth() {
        let mut sut = Record::new("clusterer", 1.0);
        (0..30).for_each(|t_s| sut.add(f64::from(t_s), &used(1, 100, 4)));
        let report = sut.report(5.0);
        assert_eq!(report.memory_kib, None);
        assert!(report.files.is_some());
    }
}

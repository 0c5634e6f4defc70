use std::collections::VecDeque;
use std::fs::File;
use std::path::Path;

use events::{Event, Severity};
use messages::Verdict;
use recorder::{Buckets, Merge};
use runtime::page::Counts;
use runtime::{Plan, SOURCE};
use transport::Instance;

use super::{Answers, Csv, Level, Pages, Record, SharedMemory, Tail, Use, own_cpu_s};
use crate::SoakError;
use crate::statistics::{Answer, Availability, Exclusions, Window};

/// Most windows of latency.
const MOST_WINDOWS: usize = 120;
/// Most places of a plot of samples, and their length at first [ns].
const MOST_SAMPLES: usize = 300;
const SAMPLE_NS: u64 = 1_000_000_000;
/// Processes that are told apart.
pub(crate) const PROCESSES: usize = 8;
/// Looks whose least counts as what is there: a file that is open for a moment does not.
const LATEST: usize = 3;
/// Grave events that are kept word by word.
const MOST_EVENTS: usize = 500;
/// Lives that a stage may have beyond its budget: with built-in parameters and as a stand-in, three each, and the one that is given
/// up.
const BUILT_IN_LIVES: usize = 7;
/// Where nothing says how far sweeps are apart [ns].
const PERIOD_NS: u64 = 100_000_000;

/// Stretches of time that do not count.
#[derive(Default)]
pub(crate) struct Marks {
    /// The source stood still because it was told to.
    pub(crate) paused: Exclusions,
    /// A fixed time from each injection.
    pub(crate) after_injections: Exclusions,
    /// From each injection until some time after its end.
    pub(crate) faults: Exclusions,
}

/// What the processes used over a stretch of time.
#[derive(Clone, Default)]
pub(crate) struct Sampled {
    pub(crate) looks: u64,
    /// By process: sum over the looks.
    pub(crate) rss_kib: [u64; PROCESSES],
    /// By process: looks at which it was there.
    pub(crate) seen: [u64; PROCESSES],
    /// By process: most.
    pub(crate) files: [u64; PROCESSES],
    /// By process: most.
    pub(crate) threads: [u64; PROCESSES],
    pub(crate) shared_kib: u64,
    pub(crate) shared_files: u64,
}

impl Merge for Sampled {
    fn merge(&mut self, later: &Self) {
        self.looks += later.looks;
        for place in 0..PROCESSES {
            self.rss_kib[place] += later.rss_kib[place];
            self.seen[place] += later.seen[place];
            self.files[place] = self.files[place].max(later.files[place]);
            self.threads[place] = self.threads[place].max(later.threads[place]);
        }
        self.shared_kib = self.shared_kib.max(later.shared_kib);
        self.shared_files = self.shared_files.max(later.shared_files);
    }
}

/// Everything that is seen of a run, gathered.
pub(crate) struct Observer<'a> {
    instance: &'a Instance,
    pub(crate) plan: Plan,
    pub(crate) started_ns: u64,
    pub(crate) pages: Pages,
    answers: Answers,
    tail: Tail,
    pub(crate) records: Vec<Record>,
    /// Of each process the latest looks.
    latest: Vec<VecDeque<Use>>,
    /// Shared memory taken [KiB].
    pub(crate) shared: Level,
    /// Its length [KiB].
    pub(crate) shared_length: Level,
    /// Its objects.
    pub(crate) shared_files: Level,
    latest_shared: VecDeque<SharedMemory>,
    pub(crate) windows: Buckets<Window>,
    pub(crate) samples: Buckets<Sampled>,
    pub(crate) availability: Availability,
    pub(crate) marks: Marks,
    is_paused: bool,
    csv: Csv,
    /// Of each stage: its lives, and when they began [ns].
    lives: Vec<(u64, VecDeque<u64>)>,
    pub(crate) restarts: u64,
    /// Times that a stage was started more often than its budget allows.
    pub(crate) over_budget: u64,
    /// Whole answers that were older than allowed.
    pub(crate) stale: u64,
    pub(crate) grave: Vec<Event>,
    pub(crate) looks: u64,
    own_cpu_at_start_s: f64,
}

/// What is new since the last look.
#[derive(Default)]
pub(crate) struct Looked {
    pub(crate) answers: Vec<Answer>,
    pub(crate) events: Vec<Event>,
}

fn created(path: &Path) -> Result<File, SoakError> {
    File::create(path).map_err(SoakError::file(path))
}

impl<'a> Observer<'a> {
    /// Begins to look at a running chain for about `length_s`, writing into the folder `out`.
    pub(crate) fn new(instance: &'a Instance, out: &Path, now_ns: u64, length_s: f64) -> Result<Self, SoakError> {
        let plan = Plan::read(instance).map_err(SoakError::chain)?;
        let pages = Pages::open(instance, &plan)?;
        let period_ns = pages.of(SOURCE).map_or(0, |source| source.period_ns);
        let period_ns = if period_ns > 0 { period_ns } else { (PERIOD_NS as f64 / plan.source.rate) as u64 };
        let names: Vec<String> =
            pages.all().map(|(name, _)| name.to_owned()).chain(["supervisor".to_owned()]).collect();
        let names = names.into_iter().take(PROCESSES).collect::<Vec<_>>();
        let stretch_s = (length_s / 30.0).clamp(1.0, 60.0);
        let window_ns = (length_s / 60.0).max(1.0) * 1e9;
        let tail = Tail::new(&Plan::events_path(instance), created(&out.join("events.jsonl"))?);
        let csv = Csv::new(created(&out.join("samples.csv"))?, &columns(&names));
        Ok(Self {
            instance,
            started_ns: now_ns,
            answers: Answers::new(plan.chain.sectors, period_ns),
            tail,
            latest: vec![VecDeque::new(); names.len()],
            lives: pages.all().map(|(_, counts)| (counts.incarnation, VecDeque::new())).collect(),
            pages,
            records: names.iter().map(|name| Record::new(name, stretch_s)).collect(),
            shared: Level::new(stretch_s),
            shared_length: Level::new(stretch_s),
            shared_files: Level::new(stretch_s),
            latest_shared: VecDeque::new(),
            windows: Buckets::new(window_ns as u64, MOST_WINDOWS),
            samples: Buckets::new(SAMPLE_NS, MOST_SAMPLES),
            availability: Availability::new(period_ns, (plan.chain.deadline_ms * 1e6) as u64),
            marks: Marks::default(),
            is_paused: false,
            csv,
            restarts: 0,
            over_budget: 0,
            stale: 0,
            grave: Vec::new(),
            looks: 0,
            own_cpu_at_start_s: own_cpu_s(),
            plan,
        })
    }

    /// Time since the begin [s].
    pub(crate) fn t_s(&self, at_ns: u64) -> f64 {
        (at_ns as f64 - self.started_ns as f64) / 1e9
    }

    /// Looks at the pages and the log: a few microseconds.
    pub(crate) fn look(&mut self, now_ns: u64) -> Looked {
        self.looks += 1;
        self.pages.look();
        self.note_pause(now_ns);
        self.note_lives(now_ns);
        let answers = match self.sink().copied() {
            Some(sink) => self.answers.look(&sink, self.missing()),
            None => Vec::new(),
        };
        answers.iter().for_each(|answer| self.note(answer));
        let events = self.tail.read();
        let room = MOST_EVENTS.saturating_sub(self.grave.len());
        self.grave.extend(events.iter().filter(|event| event.severity >= Severity::Error).take(room).cloned());
        Looked { answers, events }
    }

    fn sink(&self) -> Option<&Counts> {
        self.pages.of(self.plan.stages().last()?)
    }

    /// Parts of all hops that were lost, dropped or rejected, those not counted that were left out on purpose.
    fn missing(&self) -> u64 {
        let shed = Verdict::RejectedShed as usize;
        self.stages().map(|counts| counts.lost + counts.dropped + counts.rejected_total() - counts.rejected[shed]).sum()
    }

    /// Lost, dropped and rejected parts of all hops.
    pub(crate) fn account(&self) -> [u64; 3] {
        self.stages().fold([0; 3], |[lost, dropped, rejected], counts| {
            [lost + counts.lost, dropped + counts.dropped, rejected + counts.rejected_total()]
        })
    }

    /// The pages of the chain, without the tape.
    fn stages(&self) -> impl Iterator<Item = &Counts> {
        self.pages.all().take(self.plan.stages().count()).map(|(_, counts)| counts)
    }

    fn note(&mut self, answer: &Answer) {
        let Marks { paused, after_injections, faults } = &self.marks;
        let misses = self.availability.answer(answer, paused, after_injections, faults);
        let calm = !faults.touches(answer.due_ns, answer.answered_ns);
        let window = self.windows.at(answer.answered_ns.saturating_sub(self.started_ns));
        window.add(answer.latency_ns, calm);
        window.misses += misses;
        // Age is looked at when a part is received; after that a stage may still be busy for as long as the chain has.
        let oldest_ms = self.plan.chain.allowed_age_ms + self.plan.chain.deadline_ms;
        self.stale += u64::from(answer.whole && answer.latency_ns as f64 > oldest_ms * 1e6);
    }

    fn note_pause(&mut self, now_ns: u64) {
        let paused = self.pages.of(SOURCE).is_some_and(|source| source.paused == 1);
        if paused && !self.is_paused {
            self.marks.paused.begin(now_ns);
        } else if !paused && self.is_paused {
            // The first sweep after it is due a period later.
            self.marks.paused.end_last(now_ns + self.availability.period_ns());
        }
        self.is_paused = paused;
    }

    fn note_lives(&mut self, now_ns: u64) {
        let budget = self.plan.chain.restart_budget;
        let window_ns = (budget.window_s * 1e9) as u64;
        for ((_, counts), (lives, begins)) in self.pages.all().zip(&mut self.lives) {
            for _ in *lives..counts.incarnation {
                self.restarts += 1;
                self.windows.at(now_ns.saturating_sub(self.started_ns)).restarts += 1;
                begins.push_back(now_ns);
            }
            *lives = counts.incarnation;
            while begins.front().is_some_and(|begin| begin + window_ns < now_ns) {
                begins.pop_front();
            }
            if begins.len() > budget.restarts as usize + BUILT_IN_LIVES {
                self.over_budget += 1;
                begins.clear();
            }
        }
    }

    /// Looks at what the processes and shared memory use, once a second.
    pub(crate) fn sample(&mut self, now_ns: u64, supervisor: u64) {
        if self.pages.find_again() {
            self.lives = self.pages.all().map(|(_, counts)| (counts.incarnation, VecDeque::new())).collect();
        }
        let t_s = self.t_s(now_ns);
        let pids: Vec<u64> = self.pages.all().map(|(_, counts)| counts.pid).chain([supervisor]).collect();
        let shared = SharedMemory::of(self.instance);
        self.shared.add(t_s, shared.kib);
        self.shared_length.add(t_s, shared.length_kib);
        self.shared_files.add(t_s, shared.files);
        push(&mut self.latest_shared, shared);
        let sampled = self.samples.at(now_ns.saturating_sub(self.started_ns));
        sampled.looks += 1;
        sampled.shared_kib = sampled.shared_kib.max(shared.kib);
        sampled.shared_files = sampled.shared_files.max(shared.files);
        let mut row = vec![format!("{t_s:.3}")];
        for (place, pid) in pids.into_iter().take(self.records.len()).enumerate() {
            let used = Use::of(pid);
            if let Some(used) = used {
                self.records[place].add(t_s, &used);
                if self.latest[place].back().is_some_and(|before| before.pid != pid) {
                    self.latest[place].clear();
                }
                push(&mut self.latest[place], used);
                sampled.rss_kib[place] += used.rss_kib;
                sampled.seen[place] += 1;
                sampled.files[place] = sampled.files[place].max(used.files);
                sampled.threads[place] = sampled.threads[place].max(used.threads);
            }
            row.extend(used.map_or(vec![String::new(); 6], |used| {
                vec![
                    used.pid.to_string(),
                    used.rss_kib.to_string(),
                    used.own_kib.to_string(),
                    used.files.to_string(),
                    used.threads.to_string(),
                    format!("{:.2}", used.cpu_s),
                ]
            }));
        }
        let [lost, dropped, rejected] = self.account();
        let tally = self.availability.overall;
        let latency_ms = self.sink().map_or(0.0, |sink| sink.latency_ns as f64 / 1e6);
        let step = self.pages.of(SOURCE).map_or(0, |source| source.step);
        row.extend(
            [shared.files, shared.length_kib, shared.kib, tally.due, tally.in_time].map(|value| value.to_string()),
        );
        row.push(format!("{latency_ms:.3}"));
        row.extend([lost, dropped, rejected, self.restarts, step].map(|value| value.to_string()));
        self.csv.row(&row);
    }

    /// Nothing more is asked of the chain from `now_ns` on.
    pub(crate) fn end(&mut self, now_ns: u64) {
        let Marks { paused, after_injections, faults } = &self.marks;
        let misses = self.availability.end(now_ns, paused, after_injections, faults);
        self.windows.at(now_ns.saturating_sub(self.started_ns)).misses += misses;
    }

    /// Process and least number of files of each process, over the latest looks.
    pub(crate) fn files(&self) -> Vec<(String, u64, u64)> {
        let least = |uses: &VecDeque<Use>| {
            let files = uses.iter().map(|used| used.files).min()?;
            Some((uses.back()?.pid, files))
        };
        let all = self.records.iter().zip(&self.latest);
        all.filter_map(|(record, uses)| least(uses).map(|(pid, files)| (record.name.clone(), pid, files))).collect()
    }

    /// Shared memory over the latest looks: the least of each.
    pub(crate) fn shared_memory(&self) -> SharedMemory {
        let least = |of: fn(&SharedMemory) -> u64| self.latest_shared.iter().map(of).min().unwrap_or(0);
        SharedMemory {
            files: least(|all| all.files),
            length_kib: least(|all| all.length_kib),
            kib: least(|all| all.kib),
        }
    }

    /// Events by name, and numbers of the log that nobody saw.
    pub(crate) fn events(&self) -> (&std::collections::BTreeMap<String, u64>, u64) {
        (&self.tail.counts, self.tail.skipped())
    }

    /// What this process took for all that [% of a core].
    pub(crate) fn own_cpu_pct(&self, now_ns: u64) -> f64 {
        100.0 * (own_cpu_s() - self.own_cpu_at_start_s) / self.t_s(now_ns).max(1e-3)
    }
}

fn push<T>(latest: &mut VecDeque<T>, value: T) {
    latest.push_back(value);
    if latest.len() > LATEST {
        latest.pop_front();
    }
}

fn columns(names: &[String]) -> Vec<String> {
    let mut columns = vec!["t_s".to_owned()];
    for name in names {
        columns.extend(["pid", "rss_kib", "own_kib", "files", "threads", "cpu_s"].map(|what| format!("{name}_{what}")));
    }
    let more = [
        "shared_files",
        "shared_length_kib",
        "shared_kib",
        "sweeps_due",
        "sweeps_in_time",
        "latency_ms",
        "lost",
        "dropped",
        "rejected",
        "restarts",
        "step",
    ];
    columns.extend(more.map(str::to_owned));
    columns
}

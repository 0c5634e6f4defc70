use super::super::activity::Activity;
use super::super::times::tests::HEALTH;
use super::*;

const MS: u64 = 1_000_000;
const SECTORS: u64 = 36;

/// A stage in the middle of a chain at 10 Hz, looked at every 5 ms, as it would be seen.
struct Bed {
    patient: Patient,
    signs: Signs,
    now_ns: u64,
    times: Times,
    is_source: bool,
    said: Vec<(u64, Change)>,
}

impl Bed {
    fn stage() -> Self {
        let signs = Signs { up: true, processes: 1, life: 1, offered: Some(0), offerer: 1, ..Signs::default() };
        Self {
            patient: Patient::default(),
            signs,
            now_ns: 1_000 * MS,
            times: Times::of(&HEALTH, 100 * MS, true),
            is_source: false,
            said: Vec::new(),
        }
    }

    fn source() -> Self {
        let bed = Self::stage();
        Self { signs: Signs { offered: None, offerer: 0, ..bed.signs }, is_source: true, ..bed }
    }

    fn fast(self) -> Self {
        Self { times: Times::of(&HEALTH, 0, false), ..self }
    }

    /// Lets time pass; before each look the signs become what they would be then.
    fn pass(&mut self, ms: u64, mut then: impl FnMut(&mut Signs, u64)) {
        for _ in 0..ms / 5 {
            self.now_ns += 5 * MS;
            then(&mut self.signs, self.now_ns);
            // As `Signs::of` does.
            let old = self.now_ns - self.signs.heartbeat_ns >= self.times.asked_ns;
            let signs = Signs { activity: self.signs.activity.filter(|_| old && self.signs.up), ..self.signs };
            let change = self.patient.look(self.now_ns, &signs, (SECTORS, self.is_source), (&self.times, &HEALTH));
            self.said.extend(change.map(|change| (self.now_ns, change)));
        }
    }

    /// Works as it should: beats, takes what is offered, sends.
    fn work(&mut self, ms: u64) {
        self.pass(ms, |signs, now_ns| {
            signs.heartbeat_ns = now_ns;
            signs.offered = signs.offered.map(|offered| offered + 2);
            signs.taken += 2;
            signs.parts += 2;
        });
    }

    /// What was said, without times.
    fn said(&self) -> Vec<Condition> {
        let began = |(_, change): &(u64, Change)| match change {
            Change::Began(condition, _) => Some(*condition),
            Change::Ended(..) => None,
        };
        self.said.iter().filter_map(began).collect()
    }
}

fn still() -> Option<Activity> {
    Some(Activity { cpu_ns: 77 * MS, run_delay_ns: 5 * MS, ..Activity::default() })
}

#[test]
fn a_stopped_stage_is_hung_within_two_sweeps_and_well_when_it_goes_on() {
    let mut bed = Bed::stage();
    bed.work(500);
    let stopped_ns = bed.now_ns;
    bed.signs.activity = Some(Activity { stopped: true, ..still().unwrap() });
    bed.pass(140, |_, _| ());
    assert_eq!(bed.said(), [], "not before one and a half sweeps");
    bed.pass(60, |signs, _| signs.offered = signs.offered.map(|offered| offered + 2));
    let [(at_ns, Change::Began(Condition::Hung, Evidence::Stopped { .. }))] = bed.said[..] else {
        panic!("{:?}", bed.said)
    };
    assert!(at_ns - stopped_ns <= 160 * MS);
    bed.work(500);
    assert!(matches!(bed.said[1..], [(_, Change::Ended(Condition::Hung, _))]), "{:?}", bed.said);
}

#[test]
fn a_stopped_stage_that_is_ended_is_not_well_in_between() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs.activity = Some(Activity { stopped: true, ..still().unwrap() });
    bed.pass(300, |_, _| ());
    // It dies: that takes some time of a core.
    bed.signs.activity = Some(Activity { runnable: true, cpu_ns: 90 * MS, ..still().unwrap() });
    bed.pass(50, |_, _| ());
    bed.signs = Signs { up: false, processes: 2, ..bed.signs };
    bed.pass(50, |_, _| ());
    assert_eq!(bed.said(), [Condition::Hung, Condition::Dead]);
    assert_eq!(bed.said.len(), 2, "{:?}", bed.said);
}

#[test]
fn a_stage_that_goes_on_with_its_part_is_not_hung_any_more() {
    let mut bed = Bed::stage().fast();
    bed.work(500);
    bed.signs.activity = still();
    bed.pass(400, |_, _| ());
    bed.pass(400, |signs, _| signs.activity.as_mut().unwrap().cpu_ns += 5 * MS);
    assert!(matches!(bed.said[1..], [(_, Change::Ended(Condition::Hung, _))]), "{:?}", bed.said);
}

#[test]
fn a_stage_that_waits_for_what_never_comes_is_hung_within_two_sweeps() {
    let mut bed = Bed::stage();
    bed.work(500);
    let blocked_ns = bed.now_ns;
    bed.signs = Signs { in_hand: true, activity: still(), ..bed.signs };
    bed.pass(400, |_, _| ());
    let [(at_ns, Change::Began(Condition::Hung, Evidence::Still { .. }))] = bed.said[..] else {
        panic!("{:?}", bed.said)
    };
    assert!(at_ns - blocked_ns <= 200 * MS, "{}", (at_ns - blocked_ns) / MS);
}

#[test]
fn a_stage_that_looks_in_vain_every_few_milliseconds_is_hung_too() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { in_hand: true, activity: still(), ..bed.signs };
    bed.pass(400, |signs, _| signs.activity.as_mut().unwrap().cpu_ns += 20_000);
    assert_eq!(bed.said(), [Condition::Hung]);
}

#[test]
fn whoever_stops_after_some_computing_is_hung_from_then_on() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { in_hand: true, activity: still(), ..bed.signs };
    bed.pass(100, |signs, _| signs.activity.as_mut().unwrap().cpu_ns += 5 * MS);
    bed.pass(100, |_, _| ());
    assert_eq!(bed.said(), [Condition::Hung]);
}

#[test]
fn a_stage_that_computes_without_end_is_slow_then_spinning() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { in_hand: true, activity: still(), ..bed.signs };
    let run = |signs: &mut Signs, _: u64| {
        let activity = signs.activity.as_mut().unwrap();
        (activity.runnable, activity.cpu_ns) = (true, activity.cpu_ns + 5 * MS);
    };
    bed.pass(990, run);
    assert_eq!(bed.said(), [Condition::Slow]);
    bed.pass(20, run);
    assert_eq!(bed.said(), [Condition::Slow, Condition::Spinning]);
}

#[test]
fn a_stage_over_its_budget_again_and_again_is_slow_and_not_hung() {
    let mut bed = Bed::stage();
    bed.work(500);
    // 110 ms for each sweep: longer than its budget, not long enough to be hung.
    for _ in 0..5 {
        bed.signs = Signs { activity: still(), in_hand: true, ..bed.signs };
        bed.pass(110, |_, _| ());
        bed.signs.overruns += 1;
        bed.signs.parts += SECTORS;
        bed.signs.in_hand = false;
        bed.work(5);
    }
    assert_eq!(bed.said(), [Condition::Slow]);
}

#[test]
fn a_long_sweep_where_nothing_paces_it_is_nothing() {
    let mut bed = Bed::stage().fast();
    bed.work(500);
    bed.signs = Signs { in_hand: true, activity: still(), ..bed.signs };
    bed.pass(25_000, |signs, _| signs.activity.as_mut().unwrap().cpu_ns += 5 * MS);
    assert_eq!(bed.said(), []);
    bed.pass(10_000, |signs, _| signs.activity.as_mut().unwrap().cpu_ns += 5 * MS);
    assert_eq!(bed.said(), [Condition::Spinning], "but not without end");
}

#[test]
fn a_stage_without_a_core_is_not_blamed() {
    let mut bed = Bed::stage();
    bed.work(500);
    // It waits for a core all the time: the kernel counts that when it gets one.
    bed.signs.activity = Some(Activity { runnable: true, ..still().unwrap() });
    bed.pass(2_000, |_, _| ());
    // It gets one for 1 ms of 20.
    bed.pass(2_000, |signs, now_ns| {
        let activity = signs.activity.as_mut().unwrap();
        activity.runnable = false;
        if now_ns.is_multiple_of(20 * MS) {
            (activity.cpu_ns, activity.run_delay_ns) = (activity.cpu_ns + MS, activity.run_delay_ns + 19 * MS);
        }
    });
    assert_eq!(bed.said().first(), Some(&Condition::Slow), "100 ms computed in 4 s without progress");
    assert_eq!(bed.said().len(), 1);
}

#[test]
fn a_slow_disk_has_more_time_than_a_deadlock() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { in_hand: true, activity: Some(Activity { blocked: true, ..still().unwrap() }), ..bed.signs };
    bed.pass(990, |_, _| ());
    assert_eq!(bed.said(), []);
    bed.pass(50, |_, _| ());
    assert_eq!(bed.said(), [Condition::Hung]);
}

#[test]
fn a_stage_that_is_awake_and_takes_nothing_is_silent_after_two_sweeps() {
    let mut bed = Bed::stage();
    bed.work(500);
    let beat = |signs: &mut Signs, now_ns| {
        signs.heartbeat_ns = now_ns;
        signs.offered = signs.offered.map(|offered| offered + 1);
    };
    bed.pass(190, beat);
    assert_eq!(bed.said(), []);
    bed.pass(20, beat);
    assert_eq!(bed.said(), [Condition::Silent]);
    bed.pass(5, |signs, _| signs.taken = signs.offered.unwrap());
    assert!(matches!(bed.said[1..], [(_, Change::Ended(Condition::Silent, _))]), "{:?}", bed.said);
}

#[test]
fn a_stage_whose_input_does_not_come_is_well() {
    let mut bed = Bed::stage();
    bed.work(500);
    // The stage before is the sick one.
    bed.pass(3_000, |signs, now_ns| signs.heartbeat_ns = now_ns);
    assert_eq!(bed.said(), []);
}

#[test]
fn what_a_dead_stage_may_have_sent_is_not_waited_for() {
    let mut bed = Bed::stage();
    bed.work(500);
    let beat = |signs: &mut Signs, now_ns| signs.heartbeat_ns = now_ns;
    // It died, and whether its last part went out is in doubt: it counts as sent.
    bed.signs.offerer = 0;
    bed.signs.offered = bed.signs.offered.map(|offered| offered + 1);
    bed.pass(1_000, beat);
    // Its successor is up and has nothing to send.
    bed.signs.offerer = 2;
    bed.pass(1_000, beat);
    assert_eq!(bed.said(), []);
    bed.signs.offered = bed.signs.offered.map(|offered| offered + 1);
    bed.pass(300, beat);
    assert_eq!(bed.said(), [Condition::Silent], "what the successor sends is");
}

#[test]
fn a_source_that_sends_nothing_is_silent_unless_it_is_to_send_nothing() {
    let mut bed = Bed::source();
    bed.work(500);
    let beat = |signs: &mut Signs, now_ns| signs.heartbeat_ns = now_ns;
    bed.signs.idle = true;
    bed.pass(3_000, beat);
    assert_eq!(bed.said(), [], "paused, at its end, waiting for a step or for room");
    bed.signs.idle = false;
    bed.pass(190, beat);
    assert_eq!(bed.said(), []);
    bed.pass(20, beat);
    assert_eq!(bed.said(), [Condition::Silent]);
    bed.work(5);
    assert!(matches!(bed.said[1..], [(_, Change::Ended(Condition::Silent, _))]));
}

#[test]
fn a_source_that_floods_is_found_within_two_sweeps() {
    let mut bed = Bed::source();
    bed.work(500);
    let began_ns = bed.now_ns;
    bed.pass(200, |signs, now_ns| {
        signs.heartbeat_ns = now_ns;
        (signs.taken, signs.parts) = (signs.taken + SECTORS, signs.parts + SECTORS);
    });
    assert_eq!(bed.said(), [Condition::Flooding]);
    assert!(bed.said[0].0 - began_ns <= 200 * MS);
}

#[test]
fn a_process_that_says_too_much_floods() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.pass(100, |signs, now_ns| (signs.heartbeat_ns, signs.said) = (now_ns, signs.said + 50));
    assert_eq!(bed.said(), [Condition::Flooding]);
}

#[test]
fn who_is_not_up_yet_or_was_told_to_leave_is_not_judged() {
    let mut bed = Bed::stage();
    bed.signs = Signs { up: false, activity: still(), offered: Some(7), ..bed.signs };
    bed.pass(5_000, |_, _| ());
    assert_eq!(bed.said(), [], "start-up");
    bed.signs.up = true;
    bed.work(500);
    bed.signs = Signs { told: true, up: false, ..bed.signs };
    bed.pass(5_000, |_, _| ());
    assert_eq!(bed.said(), [], "told to leave");
    bed.signs = Signs { told: false, starts: true, processes: 2, ..bed.signs };
    bed.pass(100, |_, _| ());
    bed.signs = Signs { up: true, starts: false, life: 2, ..bed.signs };
    bed.work(500);
    assert_eq!(bed.said(), [], "and started again");
    bed.signs = Signs { up: false, processes: 3, ..bed.signs };
    bed.pass(5, |_, _| ());
    assert_eq!(bed.said(), [Condition::Dead]);
}

#[test]
fn a_death_is_said_at_the_next_look_and_over_when_a_successor_is_up() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { up: false, processes: 2, ..bed.signs };
    bed.pass(5, |_, _| ());
    assert!(matches!(bed.said[..], [(_, Change::Began(Condition::Dead, Evidence::Ended { process: 1 }))]));
    bed.pass(300, |_, _| ());
    bed.signs = Signs { up: true, life: 2, ..bed.signs };
    bed.work(500);
    assert!(matches!(bed.said[1..], [(_, Change::Ended(Condition::Dead, _))]), "{:?}", bed.said);
}

#[test]
fn a_death_at_start_up_is_said_too_and_once_however_many_follow() {
    let mut bed = Bed::stage();
    bed.signs.up = false;
    bed.pass(5, |_, _| ());
    for process in 2..5 {
        bed.signs.processes = process;
        bed.pass(50, |_, _| ());
    }
    assert!(matches!(bed.said[..], [(_, Change::Began(Condition::Dead, Evidence::Ended { process: 1 }))]));
}

#[test]
fn a_process_that_does_not_come_up_is_hung_after_ten_seconds_and_so_is_its_successor() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs = Signs { up: false, starts: true, processes: 2, ..bed.signs };
    bed.pass(9_990, |_, _| ());
    assert_eq!(bed.said(), [Condition::Dead]);
    bed.pass(20, |_, _| ());
    assert_eq!(bed.said(), [Condition::Dead, Condition::Hung]);
    bed.signs.processes = 3;
    bed.pass(9_990, |_, _| ());
    assert_eq!(bed.said(), [Condition::Dead, Condition::Hung, Condition::Dead], "it was ended");
    bed.pass(20, |_, _| ());
    assert_eq!(bed.said()[3..], [Condition::Hung]);
}

#[test]
fn one_condition_at_a_time_is_said_and_the_gravest() {
    let mut bed = Bed::stage();
    bed.work(500);
    bed.signs.overruns += 3;
    bed.signs.parts += 3 * SECTORS;
    bed.work(5);
    assert_eq!(bed.said(), [Condition::Slow]);
    bed.signs.activity = Some(Activity { stopped: true, ..still().unwrap() });
    bed.pass(300, |_, _| ());
    bed.signs = Signs { up: false, processes: 2, ..bed.signs };
    bed.pass(300, |_, _| ());
    assert_eq!(bed.said(), [Condition::Slow, Condition::Hung, Condition::Dead]);
    bed.signs = Signs { up: true, life: 2, ..bed.signs };
    bed.work(500);
    assert_eq!(bed.said.len(), 4, "a new life begins anew: {:?}", bed.said);
}

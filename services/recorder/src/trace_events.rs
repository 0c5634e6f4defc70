//! Traces → events of the Trace Event Format (JSON array), which Perfetto and Chrome show.
//!
//! Each stage is a process: its main thread has the slices `make` (source), `wake-up` and `process`, further threads have
//! what waits in its queue. Slices of one thread never touch: viewers read times as floating point and may place them a
//! nanosecond early, and slices that overlap without enclosing each other are dropped.

use std::io::Write;

use messages::{Hop, MAX_HOPS, Part, Step, Trace};

use crate::segments::{HopSegments, Segments};
use crate::stats::Answer;

/// Parts that are shown side by side in a stage's queue; further ones follow one another in the last place.
const LANES: usize = 32;
/// Shortest slice [ns]: something must be strictly inside for a flow to be bound to.
const LEAST_SLICE_NS: u64 = 3;

/// A part as the writer of the trace file gets it.
#[derive(Clone, Copy)]
pub(crate) struct Traced {
    pub(crate) trace: Trace,
    /// The answer that its sweep had with it.
    pub(crate) answer: Option<Answer>,
}

/// Writes events; remembers what is needed to tell changes.
pub(crate) struct TraceEvents {
    /// Names by position, the recorder's last.
    names: Vec<String>,
    threads: [Threads; MAX_HOPS],
    incarnations: [Option<u32>; MAX_HOPS],
    step: Step,
    /// The ordinal that should come; none before the first part.
    next_ordinal: Option<u64>,
    /// This process has taken over from one that died, and has not said so yet.
    resumed: bool,
}

/// Where the slices of a stage's threads end so far [ns].
#[derive(Clone, Copy, Default)]
struct Threads {
    work_ns: u64,
    lanes_ns: [u64; LANES],
}

/// A slice's place on its thread [ns].
struct Place {
    start_ns: u64,
    finish_ns: u64,
}

impl Place {
    /// After all that is on the thread, which then ends with it.
    fn after(end_ns: &mut u64, start_ns: u64, finish_ns: u64) -> Self {
        let start_ns = start_ns.max(*end_ns);
        let finish_ns = finish_ns.max(start_ns.saturating_add(LEAST_SLICE_NS));
        *end_ns = finish_ns;
        Self { start_ns, finish_ns }
    }

    fn middle_ns(&self) -> u64 {
        self.start_ns + (self.finish_ns - self.start_ns) / 2
    }
}

impl TraceEvents {
    /// `stages` by position, without the recorder. `resumed`: the file is that of a life before.
    pub(crate) fn new(stages: &[String], resumed: bool) -> Self {
        let names = stages.iter().map(String::as_str).chain(["recorder"]).map(str::to_owned).collect();
        Self {
            names,
            threads: [Threads::default(); MAX_HOPS],
            incarnations: [None; MAX_HOPS],
            step: Step::Nominal,
            next_ordinal: None,
            resumed,
        }
    }

    /// The file's beginning, or what a new life adds first: names of processes and threads. Gives the number of events.
    pub(crate) fn begin(&self, bytes: &mut Vec<u8>) -> u64 {
        let mut events = 0;
        for (position, name) in self.names.iter().enumerate() {
            let (pid, name) = (pid(position), json(name));
            let process_name =
                format_args!(r#"{{"name":"process_name","ph":"M","pid":{pid},"tid":{pid},"args":{{"name":{name}}}}}"#);
            if position == 0 && !self.resumed {
                bytes.extend_from_slice(b"[\n");
                put(bytes, process_name);
            } else {
                event(bytes, process_name);
            }
            event(
                bytes,
                format_args!(
                    r#"{{"name":"process_sort_index","ph":"M","pid":{pid},"tid":{pid},"args":{{"sort_index":{pid}}}}}"#
                ),
            );
            name_thread(bytes, pid, pid, &name);
            events += 3;
        }
        events
    }

    /// The file's end.
    pub(crate) const END: &'static [u8] = b"\n]\n";

    /// Appends a part's events, each with the comma before it. Gives their number.
    pub(crate) fn add(&mut self, Traced { trace, answer }: &Traced, bytes: &mut Vec<u8>) -> u64 {
        let segments = Segments::of(trace);
        let mut events = self.changes(trace, bytes);
        let mut sent_ns = None;
        for (position, (hop, segments)) in trace.hops().iter().zip(&segments.hops).enumerate() {
            if let Some(sent_ns) = sent_ns {
                events += self.queue(position, trace.part, (hop, segments), sent_ns, bytes);
                self.wake_up(position, trace.part, hop, sent_ns, bytes);
                events += 1;
            }
            let place = self.work(position, trace.part, hop, segments.taken_ns(), bytes);
            events += 1;
            if trace.part.is_last() && trace.hops().len() > 1 {
                let phase = match position {
                    0 => r#""s""#,
                    last if last + 1 == trace.hops().len() => r#""f","bp":"e""#,
                    _ => r#""t""#,
                };
                let (ts, pid, sweep) = (micros(place.middle_ns()), pid(position), trace.part.sweep);
                event(
                    bytes,
                    format_args!(
                        r#"{{"name":"sweep","cat":"sweep","ph":{phase},"id":{sweep},"ts":{ts},"pid":{pid},"tid":{pid}}}"#
                    ),
                );
                events += 1;
            }
            sent_ns = Some(hop.finished_ns);
        }
        events + self.answer(trace, *answer, sent_ns.unwrap_or_default(), bytes)
    }

    /// What is not as it was with the part before.
    fn changes(&mut self, trace: &Trace, bytes: &mut Vec<u8>) -> u64 {
        let mut events = 0;
        let recorder = self.names.len() - 1;
        let Some(arrived_ns) = trace.hops().last().map(|hop| hop.finished_ns) else { return 0 };
        if std::mem::take(&mut self.resumed) {
            instant(bytes, recorder, "restart", arrived_ns, format_args!(""));
            events += 1;
        }
        let ordinal = trace.part.ordinal;
        if let Some(missing) = self.next_ordinal.and_then(|next| ordinal.checked_sub(next)).filter(|&parts| parts > 0) {
            let args = format_args!(r#""first_ordinal":{},"parts":{missing}"#, ordinal - missing);
            instant(bytes, recorder, "missing", arrived_ns, args);
            events += 1;
        }
        self.next_ordinal = Some(ordinal.saturating_add(1));
        for (position, (hop, known)) in trace.hops().iter().zip(&mut self.incarnations).enumerate() {
            if known.is_some_and(|known| hop.incarnation > known) {
                let args = format_args!(r#""incarnation":{}"#, hop.incarnation);
                instant(bytes, position, "restart", hop.started_ns, args);
                events += 1;
            }
            *known = Some(hop.incarnation);
        }
        let (before, step) = (self.step, trace.part.step());
        if before != step {
            let args = format_args!(r#""from":"{}","to":"{}""#, before.name(), step.name());
            instant(bytes, 0, "step", trace.hops[0].started_ns, args);
            self.step = step;
            events += 1;
        }
        events
    }

    fn queue(
        &mut self,
        position: usize,
        part: Part,
        (hop, segments): (&Hop, &HopSegments),
        sent_ns: u64,
        bytes: &mut Vec<u8>,
    ) -> u64 {
        if segments.queued_ns == 0 {
            return 0;
        }
        let lanes = &mut self.threads[position].lanes_ns;
        let lane = lanes.iter().position(|&end_ns| end_ns <= sent_ns).unwrap_or(LANES - 1);
        let (pid, tid) = (pid(position), 100 * pid(position) + lane);
        let unnamed = lanes[lane] == 0;
        if unnamed {
            name_thread(bytes, pid, tid, &format!("\"queue {}\"", lane + 1));
        }
        let place = Place::after(&mut lanes[lane], sent_ns, hop.free_ns.min(hop.received_ns));
        let Part { sweep, sector, .. } = part;
        slice(bytes, "queued", &place, (pid, tid), format_args!(r#""sweep":{sweep},"sector":{sector}"#));
        1 + u64::from(unnamed)
    }

    fn wake_up(&mut self, position: usize, part: Part, hop: &Hop, sent_ns: u64, bytes: &mut Vec<u8>) {
        let work_ns = &mut self.threads[position].work_ns;
        let place = Place::after(work_ns, hop.free_ns.max(sent_ns), hop.started_ns);
        let (Part { sweep, sector, .. }, pid) = (part, pid(position));
        slice(bytes, "wake-up", &place, (pid, pid), format_args!(r#""sweep":{sweep},"sector":{sector}"#));
    }

    fn work(&mut self, position: usize, part: Part, hop: &Hop, taken_ns: u64, bytes: &mut Vec<u8>) -> Place {
        let work_ns = &mut self.threads[position].work_ns;
        // The source takes a part in hand, makes it, and waits for its time.
        let start_ns = if position == 0 { hop.received_ns } else { hop.started_ns };
        let place = Place::after(work_ns, start_ns, hop.finished_ns);
        let (Part { sweep, sector, .. }, pid) = (part, pid(position));
        let name = if position == 0 { "make" } else { "process" };
        let (verdict, step, taken) = (hop.verdict.name(), part.step().name(), millis(taken_ns));
        let args = format_args!(
            r#""sweep":{sweep},"sector":{sector},"verdict":"{verdict}","step":"{step}","taken_ms":{taken}"#
        );
        slice(bytes, name, &place, (pid, pid), args);
        place
    }

    fn answer(&self, trace: &Trace, answer: Option<Answer>, answered_ns: u64, bytes: &mut Vec<u8>) -> u64 {
        let Some(Answer { end_to_end_ns, missed }) = answer else { return 0 };
        let recorder = self.names.len() - 1;
        let (ts, pid, ms) = (micros(answered_ns), pid(recorder), millis(end_to_end_ns));
        event(
            bytes,
            format_args!(r#"{{"name":"end to end","ph":"C","ts":{ts},"pid":{pid},"tid":{pid},"args":{{"ms":{ms}}}}}"#),
        );
        let Some(cause) = missed else { return 1 };
        let (sweep, cause) = (trace.part.sweep, json(&cause.name(&self.names)));
        let args = format_args!(r#""sweep":{sweep},"end_to_end_ms":{ms},"cause":{cause}"#);
        instant(bytes, recorder, "deadline miss", answered_ns, args);
        2
    }
}

fn slice(bytes: &mut Vec<u8>, name: &str, place: &Place, (pid, tid): (usize, usize), args: std::fmt::Arguments<'_>) {
    let (ts, dur) = (micros(place.start_ns), micros((place.finish_ns - place.start_ns).saturating_sub(1)));
    event(
        bytes,
        format_args!(r#"{{"name":"{name}","ph":"X","ts":{ts},"dur":{dur},"pid":{pid},"tid":{tid},"args":{{{args}}}}}"#),
    );
}

fn instant(bytes: &mut Vec<u8>, position: usize, name: &str, at_ns: u64, args: std::fmt::Arguments<'_>) {
    let (ts, pid) = (micros(at_ns), pid(position));
    event(
        bytes,
        format_args!(r#"{{"name":"{name}","ph":"i","s":"p","ts":{ts},"pid":{pid},"tid":{pid},"args":{{{args}}}}}"#),
    );
}

/// `name` is JSON.
fn name_thread(bytes: &mut Vec<u8>, pid: usize, tid: usize, name: &str) {
    event(bytes, format_args!(r#"{{"name":"thread_name","ph":"M","pid":{pid},"tid":{tid},"args":{{"name":{name}}}}}"#));
}

/// Appends an event and what parts it from the one before.
fn event(bytes: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    bytes.extend_from_slice(b",\n");
    put(bytes, text);
}

fn put(bytes: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    // Writing to memory cannot fail.
    let _ = bytes.write_fmt(text);
}

/// Numbers of processes begin with 1: 0 is the kernel's idle task to viewers. Its main thread has the same number; those
/// of threads differ across processes.
fn pid(position: usize) -> usize {
    position + 1
}

/// A time in µs, to the nanosecond.
fn micros(ns: u64) -> impl std::fmt::Display {
    Thousandths(ns)
}

/// A duration in ms, to the microsecond.
fn millis(ns: u64) -> impl std::fmt::Display {
    Thousandths(ns / 1_000)
}

struct Thousandths(u64);

impl std::fmt::Display for Thousandths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{:03}", self.0 / 1_000, self.0 % 1_000)
    }
}

/// A string as JSON.
fn json(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

//! A run's figures from its recording: MCAP, as `services/tape/README.md` has it, read from begin to end.

use std::collections::BTreeMap;
use std::io::Read;

use mcap::records::{MessageHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use messages::{Detections, Raw, Trace};
use prost::Message as _;
use serde_json::Value;
use zerocopy::FromZeros;

use super::figures::{Event, Recording, RunFigures, StageCount};
use super::read::RunReportError;
use super::tally::Tally;

const SWEEPS: &str = "/encke/raw/detections";
const STATUS: &str = "/encke/status";
const EVENTS: &str = "/encke/events";
/// What is said of the run in the file.
const RUN: &str = "encke.run";
/// Longest record that is read [bytes]: a chunk of a few sweeps is shorter.
const MOST_BYTES: usize = 1 << 30;
/// Events that are kept.
const MOST_EVENTS: usize = 200;

/// The fields of `foxglove.Log` that are shown.
#[derive(Clone, PartialEq, prost::Message)]
struct Log {
    #[prost(string, tag = "3")]
    message: String,
    #[prost(string, tag = "4")]
    name: String,
    /// The event's word.
    #[prost(string, tag = "5")]
    file: String,
}

/// What has been read so far.
struct Reading {
    about: BTreeMap<String, String>,
    topics: BTreeMap<u16, String>,
    messages: BTreeMap<String, u64>,
    tally: Option<Tally>,
    sweep: Box<Detections>,
    unread: u64,
    /// UTC of the first and the last message [ns].
    utc_ns: Option<(u64, u64)>,
    /// UTC of the first sweep's answer and its host time [ns]: what ties events to the timeline.
    tie: Option<(u64, u64)>,
    events: Vec<(u64, Log)>,
    event_count: u64,
    /// By word.
    counts: BTreeMap<String, u64>,
    stages: Vec<StageCount>,
}

/// Reads a recording of the name `file`. What is intact before a tear is used.
pub(crate) fn read(mut input: impl Read, file: String) -> Result<RunFigures, RunReportError> {
    let sweep = Detections::new_box_zeroed().map_err(|_| std::io::Error::from(std::io::ErrorKind::OutOfMemory))?;
    let mut reading = Reading {
        about: BTreeMap::new(),
        topics: BTreeMap::new(),
        messages: BTreeMap::new(),
        tally: None,
        sweep,
        unread: 0,
        utc_ns: None,
        tie: None,
        events: Vec::new(),
        event_count: 0,
        counts: BTreeMap::new(),
        stages: Vec::new(),
    };
    let options = LinearReaderOptions::default().with_validate_chunk_crcs(true).with_record_length_limit(MOST_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let mut at: u64 = 0;
    let mut torn = None;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                let read = input.read(reader.insert(bytes.min(1 << 22)))?;
                reader.notify_read(read);
                at += read as u64;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => match mcap::parse_record(opcode, data) {
                Ok(record) => reading.record(record),
                Err(cause) => torn = torn.or(Some(format!("a record before byte {at}: {cause}"))),
            },
            Err(cause) => {
                torn = Some(format!("before byte {at}: {cause}"));
                break;
            }
        }
    }
    reading.figures(file, torn).ok_or(RunReportError::NoSweeps(SWEEPS))
}

impl Reading {
    fn record(&mut self, record: Record<'_>) {
        match record {
            Record::Metadata(metadata) if metadata.name == RUN => self.about = metadata.metadata,
            Record::Channel(channel) => drop(self.topics.insert(channel.id, channel.topic)),
            Record::Message { header, data } => self.message(&header, &data),
            _ => {}
        }
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let Some(topic) = self.topics.get(&header.channel_id).cloned() else { return };
        let utc_ns = header.publish_time;
        let (first, last) = self.utc_ns.unwrap_or((utc_ns, utc_ns));
        self.utc_ns = Some((first.min(utc_ns), last.max(utc_ns)));
        match topic.as_str() {
            SWEEPS => self.sweep(utc_ns, data),
            STATUS => self.status(data),
            EVENTS => {
                if let Ok(log) = Log::decode(data) {
                    self.event(utc_ns, log);
                }
            }
            _ => {}
        }
        *self.messages.entry(topic).or_default() += 1;
    }

    /// Counts an event by its word; restarts and steps are kept for the timeline. Recordings of earlier versions have no
    /// words, only what is kept, with its kind for a name.
    fn event(&mut self, utc_ns: u64, mut log: Log) {
        if !log.file.is_empty() {
            if self.counts.len() < MOST_EVENTS || self.counts.contains_key(&log.file) {
                *self.counts.entry(log.file.clone()).or_default() += 1;
            }
            match log.file.as_str() {
                "stage_restarted" => log.message = std::mem::replace(&mut log.name, "restart".to_owned()),
                "step_taken" | "step_returned" => log.name = "step".to_owned(),
                _ => return,
            }
        }
        self.event_count += 1;
        if self.events.len() < MOST_EVENTS {
            self.events.push((utc_ns, log));
        }
    }

    fn sweep(&mut self, utc_ns: u64, data: &[u8]) {
        let Some(trace) = Trace::read_raw(data).ok().and_then(|(trace, rest)| {
            self.sweep.read_raw(rest).ok()?;
            Some(trace)
        }) else {
            self.unread += 1;
            return;
        };
        if self.tally.is_none() {
            let number = |key: &str| self.about.get(key)?.parse::<f64>().ok();
            let paced = self.about.get("pace").is_none_or(|pace| pace != "fast");
            self.tally = Tally::new(paced, number("deadline_ms"), number("sectors").unwrap_or(1.0) as u64);
        }
        let answered_ns = trace.hops().last().map_or(trace.due_ns, |hop| hop.finished_ns);
        self.tie.get_or_insert((utc_ns, answered_ns));
        if let Some(tally) = &mut self.tally {
            tally.add(trace, &self.sweep);
        }
    }

    fn status(&mut self, data: &[u8]) {
        let Ok(status) = serde_json::from_slice::<Value>(data) else { return };
        if let Some(stages) = status.get("stages").and_then(|stages| serde_json::from_value(stages.clone()).ok()) {
            self.stages = stages;
        }
    }

    fn figures(self, file: String, torn: Option<String>) -> Option<RunFigures> {
        let tally = self.tally?;
        let (begin_ns, _) = tally.host_ns()?;
        let mut figures = tally.figures()?;
        let said = |key: &str| self.about.get(key).cloned().unwrap_or_default();
        (figures.encke, figures.source, figures.pace) = (said("version"), said("source"), said("pace"));
        if figures.source.is_empty() {
            figures.source.clone_from(&file);
        }
        let (tie_utc_ns, tie_host_ns) = self.tie?;
        let event = |(utc_ns, log): (u64, Log)| {
            let host_ns = i128::from(utc_ns) - i128::from(tie_utc_ns) + i128::from(tie_host_ns);
            let t_s = (host_ns - i128::from(begin_ns)) as f64 / 1e9;
            Event { t_s, kind: log.name, what: log.message }
        };
        figures.events = self.counts;
        if let Some(timeline) = &mut figures.timeline {
            timeline.events = self.events.into_iter().map(event).collect();
            timeline.event_count = self.event_count;
        }
        figures.read_from = Some(Recording {
            file,
            written_utc: self.utc_ns.map(|(first, last)| [utc(first), utc(last)]),
            messages: self.messages,
            unread: self.unread,
            torn,
            stages: self.stages,
        });
        Some(figures)
    }
}

/// Year, month, day and time of a moment since 1970 [ns], in UTC.
fn utc(ns: u64) -> String {
    let seconds = ns / 1_000_000_000;
    // Days since 0000-03-01, so that a leap day is the last of its year; 146097 days are 400 years.
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = 400 * era + year + u64::from(month <= 2);
    let of_day = seconds % 86_400;
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02}", of_day / 3600, of_day / 60 % 60, of_day % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds: u64| utc(seconds * 1_000_000_000);
        assert_eq!(at(0), "1970-01-01 00:00:00");
        assert_eq!(at(951_782_400), "2000-02-29 00:00:00");
        assert_eq!(at(1_709_251_199), "2024-02-29 23:59:59");
        assert_eq!(at(4_107_542_400), "2100-03-01 00:00:00");
    }
}

//! The page: what stands where.

use super::figures::{Recorded, RunFigures};
use super::parts::count;
use super::plot::plain;
use super::{budget_plots, detection_plots, latency_plots, ledger_table, tables, usage_plots, verdict, worst_plot};
use crate::page::{document, escaped};

const MORE_STYLE: &str = "\
:root{color-scheme:light dark}h1{margin-bottom:10px}h3{font-size:16px;margin:22px 0 4px}figure{margin:4px 0 18px}\
p,figcaption{max-width:60em}.key{font:13px/1.5 sans-serif;margin:10px 0 2px;display:flex;flex-wrap:wrap;gap:2px 16px;max-width:none}\
.key span{white-space:nowrap}.key svg{display:inline-block;vertical-align:-2px;margin-right:5px}\
.verdict{border-left:6px solid;padding:8px 14px;margin:14px 0;background:#f4f4f2}.verdict.fine{border-color:#009E73}\
.verdict.fair{border-color:#E69F00}.verdict.bad{border-color:#D55E00}.verdict.unknown{border-color:#8A8A8A}.sign{font:700 18px sans-serif;margin-right:4px}\
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(116px,1fr));gap:8px;margin:14px 0 4px;font-family:sans-serif}\
.tiles div{border:1px solid #ddd;padding:8px 10px}.note{font-size:14px}.tiles b{display:block;font-size:21px;font-weight:600}.tiles span{font-size:12px;line-height:1.3;display:block;color:#555}\
.absent{color:#555;font-style:italic;border:1px dashed #bbb;padding:8px 12px}.good{font-family:sans-serif}\
.side>div{flex:1 1 460px;min-width:0}.dot{display:inline-block;width:10px;height:10px;border-radius:2px;margin-right:6px}\
table.plain td{border:0;padding:2px 10px 2px 0;vertical-align:middle}svg.bar{display:block}ul.small{font:13px/1.45 sans-serif;columns:2;max-width:none}\
svg.own{font:12px sans-serif;fill:#222}svg .grid{stroke:#ddd;fill:none}svg .axis{stroke:#999;fill:none}svg .faint{fill:#666}\
code{white-space:nowrap}.absent{max-width:none}footer{margin-top:48px;color:#666;font:13px sans-serif}\
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}\
@media print{main{max-width:none;padding:0}h2{break-after:avoid}figure,table,.tiles{break-inside:avoid}.key{break-after:avoid}}\
@media screen and (prefers-color-scheme:dark){body{background:#16181b;color:#ddd}h2{border-color:#444}th{background:#24272b}\
th,td,.tiles div{border-color:#3a3e44}dt,td small,.note,.tiles span,.absent,footer,svg .faint{color:#a5a9b0;fill:#a5a9b0}\
.verdict{background:#202327}svg text,svg.own{fill:#ddd}svg [stroke=\"#DDDDDD\"],svg .grid{stroke:#33373c}\
svg [fill=\"#444444\"]{fill:#bbb}svg [stroke=\"#444444\"]{stroke:#bbb}svg [stroke=\"#0072B2\"]{stroke:#3a9bdc}svg [fill=\"#0072B2\"],.dot[style*=\"#0072B2\"]{fill:#3a9bdc}}";

impl RunFigures {
    /// The page: one file that needs no script, font or address.
    pub fn to_html(&self) -> String {
        let body = [
            self.head(),
            verdict::section(self),
            latency_plots::section(self),
            budget_plots::section(self),
            ledger_table::misses(self),
            worst_plot::section(self),
            ledger_table::section(self),
            usage_plots::section(self),
            tables::processes(self),
            detection_plots::section(self),
            tables::events(self),
            format!("<footer>Written by <code>encke report</code>, Encke {}.</footer>", env!("CARGO_PKG_VERSION")),
        ];
        let name = escaped(short(&self.source));
        document(&format!("Encke: {name}"), MORE_STYLE, &body.concat())
    }

    fn head(&self) -> String {
        let mut rows: Vec<(&str, String)> = Vec::new();
        rows.push(("Source", escaped(&self.source)));
        let pace = match self.pace.as_str() {
            "realtime" => "real time".to_owned(),
            "fast" => "as fast as it goes, nothing dropped".to_owned(),
            "" => "not said".to_owned(),
            other => escaped(other),
        };
        let period = self.period_ms.filter(|period| *period > 0.0).map_or(String::new(), |period| {
            format!("; a sweep takes {} ms ({} Hz)", plain(period), plain((1e5 / period).round() / 100.0))
        });
        rows.push(("Pace", pace + &period));
        let sectors = match self.sectors {
            0 => String::new(),
            1 => ", each whole".to_owned(),
            sectors => format!(", each in {sectors} sectors"),
        };
        let complete = self.complete_sweeps.map_or(String::new(), |sweeps| format!("; {} complete", count(sweeps)));
        let returns = self.returns.map_or(String::new(), |returns| format!("; {} returns", count(returns)));
        rows.push(("Sweeps", format!("{}{sectors}{complete}{returns}", count(self.sweeps))));
        let refused: Vec<String> =
            self.refused.iter().map(|(why, number)| format!("{} {}", count(*number), escaped(why))).collect();
        if !refused.is_empty() {
            rows.push(("Returns refused", refused.join(", ")));
        }
        if let Some(length_s) = self.duration_s {
            rows.push(("Length", span(length_s)));
        }
        if let Some(range_m) = self.cluster_range_m {
            rows.push(("Range d", format!("{} m", plain(range_m))));
        }
        let steps: Vec<String> =
            self.steps.iter().map(|(step, sweeps)| format!("{} {}", count(*sweeps), escaped(step))).collect();
        if self.steps.keys().any(|step| step != "nominal") {
            rows.push(("Sweeps by step", steps.join(", ")));
        }
        if !self.machine.is_empty() {
            rows.push(("Machine", escaped(&self.machine)));
        }
        if let Some(Recorded { file, topics, files, bytes }) = &self.recording {
            let (messages, lost) = topics.iter().fold((0, 0), |(all, lost), of| (all + of.messages, lost + of.lost));
            let mib = *bytes as f64 / f64::from(1 << 20);
            let (messages, lost) = (count(messages), count(lost));
            let what = format!("{}: {messages} messages, {lost} lost; {files} files, {mib:.1} MiB", escaped(file));
            rows.push(("Recording", what));
        }
        if let Some(recording) = &self.read_from {
            rows.push(("Recording", escaped(&recording.file)));
            if let Some([first, last]) = &recording.written_utc {
                rows.push(("Written", format!("{} to {} UTC", escaped(first), escaped(last))));
            }
            let topics = recording.messages.iter();
            let topics: Vec<_> =
                topics.map(|(topic, number)| format!("{} {}", count(*number), escaped(topic))).collect();
            rows.push(("Messages", topics.join(", ")));
            if recording.unread > 0 {
                rows.push(("Not readable", format!("{} sweeps", count(recording.unread))));
            }
        }
        rows.push(("Encke", if self.encke.is_empty() { "not said".to_owned() } else { escaped(&self.encke) }));
        let rows: String = rows.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{value}</dd>")).collect();
        format!("<h1>Run of {}</h1><dl>{rows}</dl>", escaped(short(&self.source)))
    }
}

/// The last part of a path.
fn short(source: &str) -> &str {
    let name = source.trim_end_matches('/').rsplit('/').next().unwrap_or_default();
    if name.is_empty() { "the chain" } else { name }
}

fn span(length_s: f64) -> String {
    match length_s {
        s if s >= 7200.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 180.0 => format!("{:.1} min", s / 60.0),
        s => format!("{s:.1} s"),
    }
}

use std::collections::BTreeMap;
use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use lidar::ObstacleClass;
use messages::Step;
use serde::Serialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::recording::Recording;
use crate::row::Row;

/// The page's parts, in the order in which they stand in it.
const FRAME: &str = include_str!("../page/page.html");
const STYLE: &str = include_str!("../page/style.css");
const SCRIPTS: [&str; 17] = [
    include_str!("../page/decode.js"),
    include_str!("../page/store.js"),
    include_str!("../page/vector.js"),
    include_str!("../page/colours.js"),
    include_str!("../page/bodies.js"),
    include_str!("../page/shaders.js"),
    include_str!("../page/scene.js"),
    include_str!("../page/camera.js"),
    include_str!("../page/pick.js"),
    include_str!("../page/overlay.js"),
    include_str!("../page/plots.js"),
    include_str!("../page/list.js"),
    include_str!("../page/tracks.js"),
    include_str!("../page/track_list.js"),
    include_str!("../page/controls.js"),
    include_str!("../page/live.js"),
    include_str!("../page/main.js"),
];

/// Colours of the classes in the order of `ObstacleClass::ALL`: those of Okabe and Ito that are told apart by all eyes and
/// stand out on dark ground; a recording's other views have the same.
const COLOURS: [&str; 5] = ["#56b4e9", "#e69f00", "#009e73", "#d55e00", "#bebebe"];

/// Of tracks on alert.
const ALERT: &str = "#ff00ff";

/// What the page is told beside the sweeps.
#[derive(Debug)]
pub(crate) struct About<'a> {
    /// What it shows: a file's name, or a chain's.
    pub(crate) title: String,
    /// What is known of the run, word by word.
    pub(crate) run: &'a BTreeMap<String, String>,
    /// What could not be read, in words.
    pub(crate) damage: &'a [String],
    /// All sweeps.
    pub(crate) rows: &'a [Row],
    /// Places of the sweeps that it can show.
    pub(crate) kept: &'a [usize],
    /// Sweeps that were selected; more than are kept where the page would have been too large.
    pub(crate) selected: usize,
    /// Most returns of a sweep.
    pub(crate) most_points: usize,
    /// Whether sweeps are fetched from whoever served the page.
    pub(crate) served: bool,
    /// Whether there are ever more of them.
    pub(crate) live: bool,
}

impl<'a> About<'a> {
    /// Of a recording's selected sweeps, all of them in the page or all served.
    pub(crate) fn of(recording: &'a Recording, kept: &'a [usize], most_points: usize, served: bool) -> Self {
        let name = recording.path().file_name().unwrap_or_default();
        Self {
            title: name.to_string_lossy().into_owned(),
            run: recording.run(),
            damage: recording.damage(),
            rows: recording.rows(),
            kept,
            selected: kept.len(),
            most_points,
            served,
            live: false,
        }
    }
}

/// What a page may do: run its own script, wear its own style, and (served) fetch from where it came. Nothing else.
pub(crate) fn policy(served: bool) -> String {
    let hash = |text: &str| STANDARD.encode(Sha256::digest(text.as_bytes()));
    let connect = if served { "'self'" } else { "'none'" };
    format!(
        "default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; img-src data:; connect-src {connect}; \
         base-uri 'none'; form-action 'none'",
        hash(&script()),
        hash(STYLE),
    )
}

/// Writes the page with these deflated sweeps, in the order of `about.kept`; none where they are served.
pub(crate) fn write(out: &mut impl Write, about: &About, sweeps: &[Vec<u8>]) -> io::Result<()> {
    let mut parts = FRAME.split("<!-- part -->");
    let mut frame = |out: &mut dyn Write| out.write_all(parts.next().unwrap_or_default().as_bytes());
    frame(out)?;
    write!(out, "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">", policy(about.served))?;
    frame(out)?;
    write!(out, "<style>{STYLE}</style>")?;
    frame(out)?;
    write!(out, "<script type=\"application/json\" id=\"about\">{}</script>", harmless(&told(about)))?;
    data(out, "overview", &crate::overview::encode(about.rows, about.live.then_some(&[]))?)?;
    for (place, sweep) in about.kept.iter().zip(sweeps) {
        data(out, &format!("sweep-{}", about.rows[*place].sweep), sweep)?;
    }
    write!(out, "<script>{}</script>", script())?;
    frame(out)
}

fn script() -> String {
    let mut script = String::from("\"use strict\";(() => {\n");
    for part in SCRIPTS {
        script.push_str(part);
    }
    script.push_str("})();\n");
    script
}

/// Base64 holds nothing that could end the element.
fn data(out: &mut impl Write, id: &str, bytes: &[u8]) -> io::Result<()> {
    writeln!(out, "<script type=\"text/plain\" id=\"{id}\">{}</script>", STANDARD.encode(bytes))
}

/// JSON that stays within its element whatever strings it holds.
fn harmless(value: &impl Serialize) -> String {
    let text = serde_json::to_string(value).unwrap_or_default();
    text.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

fn told(about: &About) -> Value {
    let word = |key: &str| about.run.get(key).map(String::as_str);
    let classes = ObstacleClass::ALL.iter().zip(COLOURS);
    let first = about.rows.first();
    json!({
        "file": about.title,
        "version": word("version"),
        "source": word("source"),
        "sensor": word("sensor"),
        "pace": word("pace"),
        "instance": word("instance"),
        "sectors": word("sectors"),
        "deadline_ms": word("deadline_ms").and_then(|text| text.parse::<f64>().ok()),
        "sensor_time_ns": first.map(|row| row.sensor_time_ns.to_string()),
        "damage": about.damage,
        "kept": about.kept,
        "selected": about.selected,
        "most_points": about.most_points,
        "served": about.served,
        "live": about.live,
        "alert": ALERT,
        "steps": Step::ALL.map(Step::name),
        "classes": classes.map(|(class, colour)| json!({"number": *class as u8, "name": class.name(), "colour": colour}))
            .collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_word_of_a_recording_ends_the_element_that_it_stands_in() {
        let text = harmless(&json!({"file": "</script><img src=x onerror=alert(1)>&<!--"}));
        assert!(!text.contains(['<', '>', '&']), "{text}");
        let back: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["file"], "</script><img src=x onerror=alert(1)>&<!--");
    }

    #[test]
    fn the_page_s_own_parts_name_no_place_in_the_world_and_do_not_end_early() {
        assert_eq!(FRAME.matches("<!-- part -->").count(), 3);
        for part in [&[FRAME, STYLE][..], &SCRIPTS].concat() {
            for word in ["http:", "https:", "//cdn", "@import", "url(", "eval(", "innerHTML", "document.write"] {
                assert!(!part.contains(word), "{word}");
            }
        }
        for part in SCRIPTS {
            assert!(!part.contains("</") && !part.contains("<!--"), "{}", &part[..80]);
            assert!(part.lines().count() < 300);
        }
    }

    #[test]
    fn only_a_served_page_may_fetch() {
        assert!(policy(false).contains("connect-src 'none'"));
        assert!(policy(true).contains("connect-src 'self'"));
        assert!(!policy(true).contains("unsafe"));
    }
}

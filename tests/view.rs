//! `encke view` as its user runs it, and its page in a real browser: headless Chromium without a network, where it is
//! installed. With `ENCKE_CHROMIUM_REQUIRED` set, a missing browser is a failure.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../services/viewer/tests/support/rooms.rs"]
mod rooms;
mod support;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use messages::{ClosestApproach, Message, Sweep, Track, TrackState, TrackTable, Truth};
use support::{encke, text};
use tape::{About, Tape, TapeFile};
use zerocopy::FromZeros;

const SWEEPS: u64 = 3;

/// Three sweeps of the default scene as the chain records them, and how many returns each has.
fn record(path: &Path) -> Vec<usize> {
    let shipped: TapeFile = toml::from_str(include_str!("../config/tape.toml")).unwrap();
    // Small chunks, so that half a file holds something.
    let file = TapeFile { chunk_kib: 64, ..shipped };
    let about = About { source: "scenes/default.toml".to_owned(), sensor: "hdl-32e".to_owned(), ..About::default() };
    let mut tape = Tape::start(file.checked().unwrap(), path, about, None, 1).unwrap();
    let (mut simulator, mut rooms) = (rooms::scene(), rooms::Rooms::new());
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    let mut returns = Vec::new();
    for number in 0..SWEEPS {
        sweep.clear();
        truth.clear();
        simulator.sweep(number, &mut sweep, &mut truth);
        rooms.process(number, &sweep);
        let trace = rooms::trace(number, 7_000_000);
        tape.sweep(1, &trace, &sweep);
        tape.detections(1, &trace, &rooms.detections);
        tape.tracks(1, &trace, &tracks(number));
        returns.push(sweep.returns.len());
    }
    tape.finish(1).unwrap();
    returns
}

/// Two tracks, of which one is on alert and the other was not seen; with the last sweep they are not known.
fn tracks(sweep: u64) -> Box<TrackTable> {
    let mut table = TrackTable::new_box_zeroed().unwrap();
    table.time_ns = if sweep + 1 == SWEEPS { 0 } else { (sweep + 1) * 200_000_000 };
    for (id, state, alert) in [(1_026, TrackState::Confirmed, 1), (1_025, TrackState::Coasting, 0)] {
        let track = Track {
            id,
            state,
            alert,
            position_m: [10.0 - sweep as f32, 0.0, 1.0],
            velocity_mps: [-5.0, 0.0, 0.0],
            size_m: [1.0, 1.0, 2.0],
            attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
            posterior: [0.0, 0.0, 0.1, 0.9],
            class: lidar::ObstacleClass::Conical,
            approach: ClosestApproach { time_s: 2.0, collision_probability: 0.5, ..ClosestApproach::default() },
            ..Track::default()
        };
        table.tracks.push(track).unwrap();
    }
    table
}

fn view(args: &[&str]) -> Output {
    encke().arg("view").args(args).output().unwrap()
}

/// The browser, or none, said so.
fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found =
        std::env::split_paths(&path).flat_map(|dir| names.map(|name| dir.join(name))).find(|file| file.exists());
    if found.is_none() {
        assert!(std::env::var_os("ENCKE_CHROMIUM_REQUIRED").is_none(), "Chromium is required and not installed");
        eprintln!("skipped: no Chromium here");
    }
    found
}

/// What a page shows of itself, and what it said on the console.
struct Shown {
    /// `data-` attributes of the document.
    data: BTreeMap<String, String>,
    dom: String,
    console: Vec<String>,
}

impl Shown {
    fn number(&self, key: &str) -> u64 {
        self.data
            .get(key)
            .unwrap_or_else(|| panic!("no data-{key}: {:?} {:?}", self.data, self.console))
            .parse()
            .unwrap()
    }

    /// Asserts that it is drawn as it should be: so many returns, solids, something to be seen, no complaint.
    fn expect_drawn(&self, returns: usize) {
        self.expect_picture();
        assert_eq!(self.number("points"), returns as u64);
        assert!(self.number("solids") > 20, "{:?}", self.data);
    }

    /// Asserts that there is something to be seen, and no complaint.
    fn expect_picture(&self) {
        assert_eq!(self.console, [""; 0]);
        assert_eq!(self.data.get("failed"), None);
        assert_eq!(self.data.get("drawn").map(String::as_str), Some("yes"), "{:?}", self.data);
        assert_eq!(self.number("gl"), 0, "an error of WebGL");
        assert!(self.number("clusters") > 20, "{:?}", self.data);
        assert!(self.number("lit") > 2_000, "the picture is all but empty: {:?}", self.data);
        assert!(self.dom.contains("<button type=\"button\" aria-label=\"Go to cluster "), "no list");
    }
}

/// Opens a page in a browser that reaches nothing but this machine's own address.
fn show(browser: &Path, url: &str, more: &[&str]) -> Shown {
    let profile = tempfile::tempdir().unwrap();
    let [out, err] = ["out", "err"].map(|name| profile.path().join(name));
    let mut command = Command::new(browser);
    command.args(["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]);
    command.args(["--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update"]);
    command.args(["--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1", "--enable-logging=stderr"]);
    command.args(["--virtual-time-budget=20000", "--window-size=1280,800", "--dump-dom"]);
    command.arg(format!("--user-data-dir={}", profile.path().display())).args(more).arg(url);
    command.stdin(Stdio::null()).stdout(File::create(&out).unwrap()).stderr(File::create(&err).unwrap());
    let mut child = command.spawn().unwrap();
    let mut looks = 0;
    while child.try_wait().unwrap().is_none() {
        looks += 1;
        if looks > 3_000 {
            child.kill().unwrap();
            panic!("the browser did not end within 60 s");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let read = |path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    let (dom, log) = (read(out), read(err));
    let tag = dom.split_once("<html").and_then(|(_, rest)| rest.split_once('>')).map_or("", |(tag, _)| tag);
    let words = tag.split("data-").skip(1).filter_map(|word| word.split_once("=\""));
    let data = words.map(|(key, value)| (key.to_owned(), value.split('"').next().unwrap_or_default().to_owned()));
    let console = log.lines().filter(|line| line.contains(":CONSOLE")).map(str::to_owned).collect();
    Shown { data: data.collect(), dom, console }
}

#[test]
fn the_page_draws_every_sweep_in_every_colour_without_network_or_complaint() {
    let dir = tempfile::tempdir().unwrap();
    let [recording, page] = ["run.mcap", "page.html"].map(|name| dir.path().join(name));
    let returns = record(&recording);
    let output = view(&[recording.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("page.html: 3 sweeps, "), "{}", text(&output.stdout));
    assert!(!dir.path().join("page.html.part").exists());
    let Some(browser) = chromium() else { return };
    let url = format!("file://{}", page.display());
    let shown = show(&browser, &url, &[]);
    shown.expect_drawn(returns[0]);
    assert_eq!((shown.number("sweep"), shown.number("sweeps")), (0, SWEEPS));
    assert!(shown.dom.contains("<title>run.mcap · Encke</title>"));
    for (at, colour) in ["cluster", "ring", "intensity", "range", "height"].into_iter().enumerate() {
        let sweep = at % returns.len();
        let shown = show(&browser, &format!("{url}#sweep={sweep}&colour={colour}&view=top&names=1&cluster=3"), &[]);
        shown.expect_drawn(returns[sweep]);
        assert_eq!(shown.number("sweep"), sweep as u64);
    }
    show(&browser, &url, &["--window-size=360,640"]).expect_drawn(returns[0]);
    let shown = show(&browser, &format!("{url}#sweep=1&list=tracks&track=1025"), &[]);
    shown.expect_drawn(returns[1]);
    assert_eq!(shown.number("tracks"), 2);
    assert!(shown.dom.contains("aria-label=\"Go to track 1026, conical, on alert\""));
    assert!(shown.dom.contains("1 confirmed, 1 coasting, 0 tentative; 1 on alert"));
    assert_eq!(show(&browser, &format!("{url}#sweep=1&tracks=0"), &[]).number("tracks"), 0);
    let unknown = show(&browser, &format!("{url}#sweep=2&list=tracks"), &[]);
    assert!(unknown.number("tracks") == 0 && unknown.dom.contains("tracks not known in this sweep"));
}

#[test]
fn a_browser_that_cannot_draw_in_three_dimensions_is_told_so() {
    let Some(browser) = chromium() else { return };
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("run.mcap");
    record(&recording);
    assert!(view(&[recording.to_str().unwrap()]).status.success());
    let page = dir.path().join("run.html");
    let shown = show(&browser, &format!("file://{}", page.display()), &["--disable-3d-apis"]);
    let said = shown.data.get("failed").unwrap();
    assert!(said.contains("does not draw in three dimensions"), "{said}");
}

/// A served page's process, ended with the test.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_served_page_fetches_what_it_shows() {
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("run.mcap");
    let returns = record(&recording);
    let mut command = encke();
    let child = command.arg("view").arg(&recording).args(["--serve", "--first", "1"]).stdout(Stdio::piped()).spawn();
    let mut served = Served(child.unwrap());
    let mut url = String::new();
    BufReader::new(served.0.stdout.take().unwrap()).read_line(&mut url).unwrap();
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let Some(browser) = chromium() else { return };
    let shown = show(&browser, url.trim(), &[]);
    shown.expect_drawn(returns[1]);
    assert_eq!((shown.number("sweep"), shown.number("sweeps")), (1, SWEEPS - 1));
    show(&browser, &format!("{}#sweep=2", url.trim()), &[]).expect_drawn(returns[2]);
}

#[test]
fn a_running_chain_is_shown_as_it_runs() {
    let run = support::Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let mut command = encke();
    let viewing = command.args(["view", "--live", "--instance", &run.instance]).stdout(Stdio::piped()).spawn();
    let mut served = Served(viewing.unwrap());
    let mut url = String::new();
    BufReader::new(served.0.stdout.take().unwrap()).read_line(&mut url).unwrap();
    run.wait_for_more(5);
    if let Some(browser) = chromium() {
        let shown = show(&browser, url.trim(), &["--virtual-time-budget=3000"]);
        // Solids only where the chain is not overloaded.
        shown.expect_picture();
        assert!(shown.number("points") > 1_000 && shown.number("sweeps") > 1, "{:?}", shown.data);
        assert!(shown.dom.contains("deadline 100") && !shown.data.contains_key("ended"));
    }
    let stopped = encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stopped.success());
    let finished = run.collect(child).expect_code(0);
    assert_eq!(finished.report["ledger"]["closed"], true);
    assert!(served.0.wait().unwrap().success(), "the viewer leaves with the chain");
}

#[test]
fn a_torn_recording_is_shown_as_far_as_it_goes_and_that_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("run.mcap");
    let returns = record(&recording);
    let bytes = fs::read(&recording).unwrap();
    let half = bytes.len() / 2;
    fs::write(&recording, &bytes[..half]).unwrap();
    let output = view(&[recording.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = format!("run.mcap: damaged, what is intact is shown: breaks off at byte {half}");
    assert!(text(&output.stderr).contains(&said), "{}", text(&output.stderr));
    let Some(browser) = chromium() else { return };
    let shown = show(&browser, &format!("file://{}", dir.path().join("run.html").display()), &[]);
    shown.expect_drawn(returns[0]);
    assert_eq!(shown.number("damaged"), 1);
    assert!(shown.number("sweeps") < SWEEPS && shown.dom.contains(&format!("breaks off at byte {half}")));
}

#[test]
fn what_cannot_be_shown_is_refused_in_one_line_with_a_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let [recording, other] = ["run.mcap", "other.mcap"].map(|name| dir.path().join(name));
    record(&recording);
    fs::write(&other, "x,y,z\n").unwrap();
    let [recording, other] = [&recording, &other].map(|path| path.to_str().unwrap());
    for (args, words) in [
        (vec!["no/such.mcap"], "no/such.mcap: cannot be read"),
        (vec![other], "is no MCAP file; `encke run --record"),
        (vec![recording, "--first", "3"], "none of its 3 sweeps is selected"),
        (vec![recording, "--out", recording], "is the recording itself"),
        (vec![recording, "--out", "/no/such/page.html"], "--out /no/such/page.html: cannot be written"),
        (vec![recording, "--serve", "192.0.2.1:1"], "192.0.2.1:1: cannot be listened on"),
    ] {
        let output = view(&args);
        let said = text(&output.stderr);
        assert_eq!((output.status.code(), said.lines().count()), (Some(2), 1), "{args:?}: {said}");
        assert!(said.contains(words), "{said}");
    }
}

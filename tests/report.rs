//! `encke report`: a page from what a run has left.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use support::{Run, encke, text};

/// The page of a finished run's report.
fn page(folder: &Path, report: &Value) -> String {
    let (file, out) = (folder.join("r.json"), folder.join("r.html"));
    std::fs::write(&file, report.to_string()).unwrap();
    let output = encke().arg("report").arg(&file).arg("--out").arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout), format!("{}\n", out.display()));
    std::fs::read_to_string(out).unwrap()
}

// verifies GND-010 SUP-014 SUP-015
#[test]
fn a_run_has_a_page_that_says_what_its_report_says() {
    let folder = tempfile::tempdir().unwrap();
    let finished = Run::new(&["--sweeps", "20"]).finish().expect_code(0);
    let (report, timeline) = (&finished.report, &finished.report["timeline"]);
    let sum =
        |rows: &Value, name: &str| rows.as_array().unwrap().iter().map(|row| row[name].as_u64().unwrap()).sum::<u64>();
    let answered = report["latency_ms"]["end_to_end"]["count"].as_u64().unwrap();
    assert_eq!(sum(&timeline["latency_ms"], "sweeps"), answered);
    for (class, counts) in timeline["detections"].as_object().unwrap() {
        let counts = counts.as_array().unwrap().iter().map(|count| count.as_u64().unwrap());
        assert_eq!(counts.sum::<u64>(), report["detections"][class].as_u64().unwrap(), "{class}");
    }
    let points = report["latency_histogram_ms"]["end_to_end"].as_array().unwrap();
    assert_eq!(points.last().unwrap()[0], report["latency_ms"]["end_to_end"]["max"]);
    assert!(timeline["processes"]["supervisor"]["rss_kib"][0].as_u64().unwrap() > 0);
    assert_eq!(report["verdict"]["failed"], Value::Null);

    let page = page(folder.path(), report);
    for words in ["Run of default.toml", "The ledger is closed", "Slowest sweeps", "<td>clusterer</td>", "</html>"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("<script") && !page.contains("http"), "it needs nothing else");
    render(&folder.path().join("r.html"));
}

#[test]
fn a_restart_stands_in_the_timeline_at_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(&["--sweeps", "40"]);
    let child = run.start();
    run.wait_for_sweeps(10);
    run.inject(&["kill", "classifier"]);
    let finished = run.collect(child).expect_code(0);
    let event = &finished.report["timeline"]["events"][0];
    assert_eq!((&event["kind"], &event["what"]), (&"restart".into(), &"classifier (signal 9)".into()));
    let length_s = finished.report["duration_s"].as_f64().unwrap();
    assert!((0.5..length_s).contains(&event["t_s"].as_f64().unwrap()), "{event}");
    assert!(page(folder.path(), &finished.report).contains("restart: classifier (signal 9)"));
}

// verifies GND-012
#[test]
fn what_is_no_report_is_refused_in_one_line_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (bytes, words) in [(&b"{\"ledger\":"[..], "torn JSON"), (b"x,y,z\n", "some other text"), (b"", "empty")] {
        std::fs::write(path("r.json"), bytes).unwrap();
        let output = encke().arg("report").arg(path("r.json")).output().unwrap();
        let error = text(&output.stderr);
        assert_eq!((output.status.code(), error.lines().count()), (Some(2), 1), "{error}");
        assert!(error.contains("r.json") && error.contains(words), "{error}");
        assert!(!path("r.html").exists());
    }
    let output = encke().args(["report", "/no/such/file.json"]).output().unwrap();
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("/no/such/file.json"));
}

/// Shows the page in a browser without a screen, where there is one: it must find nothing to complain of.
fn render(page: &Path) {
    let picture = page.with_extension("png");
    let browser = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--window-size=1080,4000"])
        .arg(format!("--user-data-dir={}", page.with_extension("profile").display()))
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}", page.display()))
        .output();
    let Ok(output) = browser else {
        eprintln!("skipped: there is no chromium");
        return;
    };
    let said = text(&output.stderr);
    assert!(!said.contains("CONSOLE"), "{said}");
    assert!(std::fs::metadata(&picture).is_ok_and(|file| file.len() > 20_000), "{said}");
}

//! Wrong input gets one clear line and exit code 2; nothing is left behind.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use support::{Run, encke, sum, text};

/// Runs `encke` and expects it to refuse: exit 2, one line that holds all of `words`.
fn refused(args: &[&str], words: &[&str]) {
    let output = encke().args(args).output().unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{args:?} says {said:?}, must name {word:?}");
    }
    assert!(!said.contains("panicked"), "{said}");
}

/// The same with one line only.
fn refused_in_one_line(args: &[&str], words: &[&str]) {
    refused(args, words);
    let said = text(&encke().args(args).output().unwrap().stderr);
    assert_eq!(said.trim_end().lines().count(), 1, "{said:?}");
}

#[test]
fn a_source_that_is_not_there_or_not_a_recording_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    fs::write(path("empty.pcap"), b"").unwrap();
    fs::write(path("text.bin"), b"this is no recording of anything at all, only words in a row").unwrap();
    fs::create_dir(path("empty")).unwrap();
    refused_in_one_line(&["run", "--from", "no/such.pcap"], &["no/such.pcap"]);
    refused_in_one_line(&["run", "--from", &path("empty.pcap")], &["empty.pcap"]);
    refused_in_one_line(&["run", "--from", &path("text.bin")], &["text.bin"]);
    refused_in_one_line(&["run", "--from", &path("empty")], &["empty"]);
    refused_in_one_line(&["run", "--from", &path("text.bin"), "--format", "las"], &["las", "pcap"]);
}

#[test]
fn a_broken_configuration_names_file_key_and_remedy() {
    let dir = tempfile::tempdir().unwrap();
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("config"), dir.path());
    let chain = dir.path().join("chain.toml").display().to_string();
    let with = |file: &str, from: &str, to: &str, words: &[&str]| {
        let path = dir.path().join(file);
        let shipped = fs::read_to_string(&path).unwrap();
        assert!(shipped.contains(from), "{file} holds {from:?}");
        fs::write(&path, shipped.replacen(from, to, 1)).unwrap();
        refused(&["run", "--chain", &chain, "--sweeps", "1"], words);
        fs::write(&path, shipped).unwrap();
    };
    with("chain.toml", "queue_sweeps = 4", "queue_sweeps = 0", &["chain.toml", "queue_sweeps is 0", "2 to 256"]);
    with("chain.toml", "sectors = 36", "sektors = 36", &["chain.toml", "sektors"]);
    with("chain.toml", r#"reads = "Clusters""#, r#"reads = "Truth""#, &["chain.toml", "Truth"]);
    with("chain.toml", r#"name = "extractor""#, r#"name = "extraktor""#, &["extraktor"]);
    with("stages/clusterer.toml", "range_d_m = 1.0", "range_d_m = -1.0", &["stages/clusterer.toml", "range_d_m", "-1"]);
    with("stages/clusterer.toml", "range_d_m = 1.0", "range_d = 1.0", &["stages/clusterer.toml", "range_d"]);
    with("scenes/default.toml", "dropout", "dropuot", &["scenes/default.toml", "dropuot"]);
    let fewer = ["\"solids\" was trained with", "fit.evaluations = 28000", "has", "fit.evaluations = 20000"];
    with("stages/extractor.toml", "evaluations = 28000", "evaluations = 20000", &fewer);
    with("stages/extractor.toml", "solids = true", "solids = false", &["histogram and solids are both false"]);
    with("models/solids/card.toml", "sha256 = \"", "sha256 = \"0", &["solids", "sha256"]);
    with("stages/classifier.toml", "model = \"solids\"", "model = \"none\"", &["models/none/card.toml"]);
    with("stages/classifier.toml", "model = \"solids\"", "model = \"paper-svm\"", &["paper-svm", "histogram = true"]);
}

#[test]
fn the_papers_classifiers_stay_choosable() {
    let dir = tempfile::tempdir().unwrap();
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("config"), dir.path());
    let chain = dir.path().join("chain.toml").display().to_string();
    let extractor = dir.path().join("stages/extractor.toml");
    let shipped = fs::read_to_string(&extractor).unwrap();
    let histogram = shipped.replace("histogram = false", "histogram = true").replace("solids = true", "solids = false");
    fs::write(&extractor, &histogram).unwrap();
    for (method, model) in [("svm", "paper-svm"), ("naive-bayes", "paper-nb")] {
        let classifier = format!("method = \"{method}\"\nmodel = \"{model}\"\nleast_posterior = 0.0\n");
        fs::write(dir.path().join("stages/classifier.toml"), classifier).unwrap();
        let run = Run::new(&["--chain", &chain, "--sweeps", "2", "--pace", "fast"]).finish().expect_code(0);
        let classified: u64 =
            sum(&run.report["detections"]) - run.report["detections"]["unclassified"].as_u64().unwrap();
        assert!(classified > 20, "{method}: {}", run.report["detections"]);
        fs::write(&extractor, histogram.replace("spacing_deg = 0.72", "spacing_deg = 0.5")).unwrap();
        refused(&["run", "--chain", &chain, "--sweeps", "1"], &[model, "spacing_deg = 0.72", "spacing_deg = 0.5"]);
        fs::write(&extractor, &histogram).unwrap();
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    refused_in_one_line(
        &["run", "--sweeps", "1", "--detections", "/no/such/folder/d.jsonl"],
        &["/no/such/folder/d.jsonl"],
    );
    refused_in_one_line(&["run", "--sweeps", "1", "--report", "/no/such/folder/r.json"], &["/no/such/folder/r.json"]);
}

#[test]
fn an_output_never_destroys_the_source_or_another_output() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    fs::write(path("s.csv"), "x,y,z\n1,2,3\n").unwrap();
    let (source, folder) = (path("s.csv"), path(""));
    refused_in_one_line(&["run", "--from", &source, "--labels", &source], &["--labels", "the source"]);
    refused_in_one_line(&["run", "--from", &folder, "--detections", &source], &["--detections", "the source"]);
    assert_eq!(fs::read_to_string(&source).unwrap(), "x,y,z\n1,2,3\n");
    let both = path("out");
    refused_in_one_line(&["run", "--detections", &both, "--report", &both], &["--report", "--detections"]);
    assert!(!Path::new(&both).exists(), "what was only tried is gone");
    let report = path("r.json");
    fs::write(&report, "old").unwrap();
    refused(&["run", "--report", &report, "--instance", "a/b"], &["a/b"]);
    assert_eq!(fs::read_to_string(&report).unwrap(), "old");
}

#[test]
fn an_output_through_a_link_that_leads_nowhere_yet_makes_what_it_leads_to() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    let (tracks, report) = (path("tracks"), path("report"));
    std::os::unix::fs::symlink("t.jsonl", &tracks).unwrap();
    std::os::unix::fs::symlink("r.json", &report).unwrap();
    let are_links = || [&tracks, &report].iter().all(|path| fs::symlink_metadata(path).unwrap().is_symlink());
    refused_in_one_line(&["run", "--tracks", &tracks, "--labels", &path("t.jsonl")], &["--labels", "--tracks"]);
    assert!(are_links() && !dir.path().join("t.jsonl").exists(), "nothing was touched");
    let output = encke()
        .args(["run", "--sweeps", "3", "--pace", "fast", "--tracks", &tracks, "--report", &report])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(are_links());
    assert_eq!(fs::read_to_string(path("t.jsonl")).unwrap().lines().count(), 3);
    assert!(fs::read_to_string(path("r.json")).unwrap().contains("\"sweeps\""));
}

#[test]
fn a_named_pipe_is_an_output_where_somebody_reads_it() {
    let dir = tempfile::tempdir().unwrap();
    let pipes = ["tracks", "events", "report"].map(|name| dir.path().join(name).display().to_string());
    assert!(Command::new("mkfifo").args(&pipes).status().unwrap().success());
    let [tracks, events, report] = &pipes;
    for (flag, pipe) in [("--tracks", tracks), ("--events", events), ("--report", report)] {
        refused(&["run", "--sweeps", "1", flag, pipe], &[flag, pipe, "nobody reads this pipe"]);
    }
    let readers = pipes.clone().map(|pipe| Command::new("cat").arg(pipe).stdout(Stdio::piped()).spawn().unwrap());
    let output = encke()
        .args(["run", "--sweeps", "3", "--pace", "fast", "--tracks", tracks, "--events", events, "--report", report])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let [tracks, events, report] = readers.map(|reader| text(&reader.wait_with_output().unwrap().stdout));
    assert_eq!(tracks.lines().count(), 3);
    assert!(events.contains("run_ends"), "{events}");
    assert_eq!(serde_json::from_str::<Value>(&report).unwrap()["sweeps"], 3);
}

#[test]
fn the_help_names_what_the_chain_makes() {
    let help = text(&encke().arg("--help").output().unwrap().stdout);
    let words: Vec<&str> = help.split_whitespace().collect();
    assert!(words.join(" ").contains("into classified, tracked obstacles"), "{help}");
}

#[test]
fn wrong_words_on_the_command_line_are_refused_with_usage() {
    refused(&["run", "--paec", "fast"], &["--paec", "--pace"]);
    refused(&["run", "--duration", "30"], &["30", "500ms"]);
    refused(&["run", "--instance", "a/b"], &["a/b", "letters"]);
    refused(&["inject", "kill", "clusterer", "--instance", "nobody"], &["nobody", "running"]);
    refused(&["ctl", "status", "--instance", "nobody"], &["nobody"]);
    refused(&["run", "--sectors", "0"], &["sectors is 0"]);
    // An option that would change nothing is a mistake.
    refused_in_one_line(&["run", "--loop"], &["--loop", "recording"]);
    refused_in_one_line(&["run", "--sensor", "vlp-16"], &["--sensor", "recording"]);
    refused_in_one_line(&["run", "--from", "Cargo.toml.none", "--seed", "3"], &["Cargo.toml.none"]);
    refused_in_one_line(&["run", "--from", "tests", "--seed", "3"], &["--seed", "scene"]);
}

#[test]
fn a_trace_follows_every_sweep_through_every_stage() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("trace.json");
    let run = Run::new(&["--sweeps", "5", "--pace", "fast", "--trace", path.to_str().unwrap()]).finish().expect_code(0);
    let events: Vec<Value> = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let of = |phase: &str| events.iter().filter(move |event| event["ph"] == phase).collect::<Vec<_>>();
    let names: Vec<_> =
        of("M").iter().filter(|e| e["name"] == "process_name").map(|e| e["args"]["name"].clone()).collect();
    assert_eq!(names, ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"]);
    for sweep in 0..5 {
        let flow = |phase: &str| of(phase).iter().filter(|event| event["id"] == sweep).count();
        assert_eq!((flow("s"), flow("t"), flow("f")), (1, 3, 1), "sweep {sweep}");
        let worked = |name: &str| of("X").iter().filter(|e| e["name"] == name && e["args"]["sweep"] == sweep).count();
        let sectors = run.report["sectors"].as_u64().unwrap() as usize;
        assert_eq!((worked("make"), worked("process")), (sectors, 4 * sectors), "sweep {sweep}");
    }
    assert_eq!(run.report["trace"]["events"], events.len());
    assert_eq!((&run.report["trace"]["lost"], &run.report["trace"]["missing"]), (&0.into(), &0.into()));
    assert_eq!(run.report["worst_sweeps"][0]["hops"].as_array().unwrap().len(), 5);
    assert!(run.stdout().contains("slowest sweeps") && run.stdout().contains("0 parts lost"), "{}", run.stdout());
    let (trace, both) = (path.to_str().unwrap(), ["--trace", "--detections"]);
    refused_in_one_line(&["run", "--detections", trace, "--trace", trace], &both);
}

#[test]
fn two_chains_do_not_share_a_name() {
    let run = support::Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(1);
    refused_in_one_line(&["run", "--instance", &run.instance], &[&run.instance, "is running"]);
    let stop = encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    run.collect(child).expect_code(0);
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in ["run", "stage", "simulate", "train", "bench", "inject", "ctl"] {
        let output = encke().args([command, "--help"]).output().unwrap();
        assert!(output.status.success());
        assert!(text(&output.stdout).contains(&format!("encke {command}")), "{command}");
    }
    let version = text(&encke().arg("--version").output().unwrap().stdout);
    assert_eq!(version.trim(), concat!("encke ", env!("CARGO_PKG_VERSION")));
}

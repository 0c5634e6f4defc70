use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::*;
use crate::top::view::{
    DetectionRow, DetectionsView, EventView, LatencyView, StageView, TapView, TrackRow, TracksView,
};

fn view() -> View {
    let stage = |name: &str, busy: Option<f64>| StageView {
        stage: name.to_owned(),
        pid: 4711,
        state: "running",
        parts_per_s: 360.0,
        sweeps_per_s: 10.0,
        busy_pct: busy,
        busy_p50_ms: busy,
        busy_p99_ms: busy.map(|ms| ms * 2.0),
        queue: Some(3),
        received: 123_456,
        ..StageView::default()
    };
    let mut stages = vec![stage("source", Some(1.0)), stage("extractor", Some(16.5)), stage("recorder", None)];
    stages[1].restarts = 2;
    stages[1].lost = 77;
    let mut recent_ms = vec![Some(4.0); 98];
    recent_ms.extend([Some(140.0), None]);
    let row = |cluster, class| DetectionRow {
        cluster,
        class,
        p: Some(0.93),
        range_m: 12.5,
        size_m: Some([1.0, 2.0, 3.0]),
        points: 321,
    };
    let track = |number: u64| TrackRow {
        track: 2_048 + number,
        state: ["confirmed", "coasting", "tentative"][number as usize % 3],
        class: "cylindrical",
        p: Some(0.97),
        range_m: 31.25,
        speed_mps: 0.42,
        age_sweeps: 12,
        last_seen_sweeps: 0,
        time_s: (number % 3 < 2).then_some(7.5),
        distance_m: (number % 3 < 2).then_some(2.25),
        collision_probability: (number % 3 < 2).then_some(if number == 0 { 0.125 } else { 1e-4 }),
        alert: number == 0,
    };
    View {
        instance: "flight-1".to_owned(),
        source: "/a/b/scenes/default.toml".to_owned(),
        pace: "realtime",
        sectors: 36,
        uptime_s: Some(3_725.0),
        step: "nominal",
        sweep: 1_234,
        sweeps_per_s: 10.0,
        latency: LatencyView {
            deadline_ms: Some(100.0),
            sweeps: 99,
            p50_ms: Some(4.0),
            p99_ms: Some(6.25),
            max_ms: Some(140.0),
            missed: 2,
            missed_in_all: 2,
            recent_ms,
        },
        stages,
        detections: DetectionsView {
            sweep: Some(1_233),
            complete: true,
            classes: vec![("rectangular", 50), ("conical", 0)],
            rows: (0..50).map(|cluster| row(cluster, "rectangular")).collect(),
        },
        tracks: TracksView {
            sweep: Some(1_233),
            known: true,
            states: vec![("confirmed", 14), ("coasting", 13), ("tentative", 13)],
            alerts: 1,
            rows: (0..40).map(track).collect(),
        },
        events: (0..30)
            .map(|number| EventView {
                at_s: f64::from(number),
                sweep: 1,
                stage: "extractor".to_owned(),
                what: format!("restarted: life {number}"),
                grave: number == 29,
            })
            .collect(),
        tap: TapView { parts: 900, missed: 100 },
        ..View::default()
    }
}

/// The screen as lines.
fn drawn(width: u16, height: u16, view: &View, ui: &Ui) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, view, ui)).unwrap();
    let buffer = terminal.backend().buffer();
    let line = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned();
    (0..height).map(line).collect()
}

fn expect(lines: &[String], wanted: &[&str]) {
    for word in wanted {
        assert!(lines.iter().any(|line| line.contains(word)), "{word:?} in\n{}", lines.join("\n"));
    }
}

#[test]
fn the_usual_terminal_shows_every_panel() {
    let lines = drawn(80, 24, &view(), &Ui::default());
    expect(&lines, &["flight-1", "scenes/default.toml", "up 1:02:05", "sweep 1234", "2 misses", "step nominal"]);
    expect(&lines, &["extractor    running   360.0   16.5  16.50  33.00     3        2"]);
    expect(&lines, &[" stages ", " latency ", " obstacles of sweep 1233", " events ", "q quit", "100 ms ╌"]);
    expect(&lines, &["rect 50", "0.93", "12.50", "restarted: life 29"]);
    expect(
        &lines,
        &[" tracks of sweep 1233", "ALERT 1  conf 14  coas 13  tent 13", "!    2048 cyli    7.5    2.2  0.125"],
    );
    assert!(lines[1].ends_with("step nominal   ALERT #2048 p 0.125 in 7.5 s"), "{}", lines[1]);
    assert!(lines[2].contains("margin to 100: 96.0 93.8 -40.0, 2 misses"), "{}", lines[2]);
}

#[test]
fn a_wide_terminal_shows_every_column_at_once() {
    let lines = drawn(200, 60, &view(), &Ui::default());
    expect(&lines, &["pid", "MiB", "lost", "late", "123456", "1.00 × 2.00 × 3.00", "unseen here: 100 parts (10.0 %)"]);
    assert!(!lines.iter().any(|line| line.contains("more columns")));
    expect(&lines, &["    2048 cylindrical confirmed  0.42    31.2    7.5    2.2  0.125"]);
    let again = drawn(120, 45, &view(), &Ui::default());
    expect(&again, &["p99 ms", "lost", "pid"]);
}

#[test]
fn arrows_bring_the_columns_for_which_there_is_no_room() {
    let head = |columns| drawn(80, 24, &view(), &Ui { columns, ..Ui::default() })[4].clone();
    assert!(head(0).contains("busy %") && !head(0).contains("lost"));
    assert!(head(2).contains("lost"));
    assert!(head(3).contains("pid"));
}

#[test]
fn a_late_sweep_and_an_unanswered_one_have_signs_of_their_own() {
    let lines = drawn(80, 24, &view(), &Ui { panel: Panel::Latency, zoomed: true, ..Ui::default() });
    expect(&lines, &["▲", "×", "█", "╌"]);
    let last = lines.iter().rfind(|line| line.contains('█')).unwrap();
    assert!(last.ends_with("██×"), "{last}");
    let mut calm = view();
    calm.latency.recent_ms = vec![Some(4.0); 5];
    let lines = drawn(80, 24, &calm, &Ui::default());
    assert!(!lines.iter().any(|line| line.contains('▲') || line.contains('×')));
}

#[test]
fn a_small_terminal_shows_the_chosen_panel_and_a_tiny_one_a_line() {
    let lines = drawn(60, 12, &view(), &Ui { panel: Panel::Events, ..Ui::default() });
    expect(&lines, &[" events ", "restarted: life 29"]);
    assert!(!lines.iter().any(|line| line.contains(" stages ")));
    let calm = View { tracks: TracksView::default(), ..view() };
    assert!(drawn(40, 1, &calm, &Ui::default())[0].starts_with("latency p50 4.00"));
}

#[test]
fn an_alert_is_never_cut_off() {
    let alert = "ALERT #2048 p 0.125 in 7.5 s";
    for width in [40, 60, 80, 200] {
        let lines = drawn(width, 12, &view(), &Ui::default());
        assert_eq!(lines[1].starts_with(alert), width < 80, "{}", lines[1]);
        assert!(lines[1].contains(alert), "{}", lines[1]);
    }
    assert!(drawn(40, 1, &view(), &Ui::default())[0].starts_with(alert));
}

#[test]
fn no_size_is_too_small_and_no_view_too_empty() {
    for view in [view(), View::default()] {
        for width in [0, 1, 2, 7, 8, 9, 10, 45, 63, 64, 65, 149, 150, 300] {
            for height in [0, 1, 2, 3, 4, 5, 6, 7, 19, 20, 21, 33, 80] {
                for panel in Panel::ALL {
                    let far = Ui { detections_from: 1_000, tracks_from: 1_000, events_back: 1_000, ..Ui::default() };
                    let ui = Ui { panel, help: true, ..far };
                    drawn(width, height, &view, &ui);
                    drawn(width, height, &view, &Ui { zoomed: true, help: false, ..ui });
                }
            }
        }
    }
}

#[test]
fn scrolling_shows_older_events_and_farther_obstacles_and_stops_at_their_end() {
    let ui = Ui { panel: Panel::Events, zoomed: true, events_back: 1_000, ..Ui::default() };
    expect(&drawn(80, 10, &view(), &ui), &["restarted: life 0"]);
    let ui = Ui { panel: Panel::Detections, zoomed: true, detections_from: 1_000, ..Ui::default() };
    let lines = drawn(80, 10, &view(), &ui);
    expect(&lines, &["     49 rectangular"]);
    assert!(!lines.iter().any(|line| line.contains("      0 rectangular")));
}

#[test]
fn states_of_tracks_have_signs_of_their_own_and_what_is_not_known_is_called_so() {
    let ui = Ui { panel: Panel::Tracks, zoomed: true, ..Ui::default() };
    let lines = drawn(80, 24, &view(), &ui);
    expect(&lines, &["!    2048", "~    2049", "?    2050", "tentative  0.42    31.2      -      -      -", "<.001"]);
    let scrolled = drawn(80, 24, &view(), &Ui { tracks_from: 1_000, ..ui });
    expect(&scrolled, &["     2087 cylindrical"]);
    let tracks = TracksView { sweep: Some(7), ..TracksView::default() };
    expect(&drawn(80, 24, &View { tracks, ..view() }, &Ui::default()), &["of sweep 7: NOT KNOWN"]);
}

#[test]
fn a_notice_and_a_pause_are_to_be_seen() {
    let view = View { notice: Some("the chain has ended".to_owned()), uptime_s: None, ..view() };
    let lines = drawn(80, 24, &view, &Ui { paused: true, ..Ui::default() });
    expect(&lines, &["the chain has ended", "down"]);
    expect(&drawn(120, 24, &view, &Ui { paused: true, ..Ui::default() }), &["PAUSED"]);
    expect(&drawn(80, 24, &view, &Ui { help: true, ..Ui::default() }), &["the chain goes on"]);
}

#[test]
fn text_for_pipes_says_what_the_screen_says() {
    let text = crate::top::text::snapshot(&view());
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    expect(&lines, &["flight-1", "margin to 100", "123456", "sweep 1233: 50 clusters", "restarted: life 29", "93"]);
    expect(&lines, &["tracks of sweep 1233: 14 confirmed, 13 coasting, 13 tentative, 1 on alert", "ALERT #2048"]);
    expect(
        &lines,
        &["    2048  confirmed  cylindrical   0.97      0.42       31.25          2.25     7.50       0.125  ALERT"],
    );
    expect(&lines, &["and 30 clusters more", "and 20 tracks more"]);
    let bare = crate::top::text::snapshot(&View::default());
    assert!(!bare.contains(" more"), "{bare}");
}

use super::activity::Activity;
use super::*;

const MS: u64 = 1_000_000;
const FLOW: Flow = Flow { period_ns: 100 * MS, paced: true, flows: true };
const NAMES: [&str; 3] = ["source", "clusterer", "recorder"];

fn table(changes: &[(&str, &str)]) -> Table {
    let mut text = include_str!("../../../../config/executive.toml").to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from:?}");
        text = text.replacen(from, to, 1);
    }
    let chain = chain::ChainFile::parse(include_str!("../../../../config/chain.toml")).unwrap().checked().unwrap();
    chain::executive::ExecutiveFile::parse(&text).unwrap().checked(&chain).unwrap()
}

fn sut(table: &Table) -> Executive {
    Executive::new(table, NAMES.map(str::to_owned).to_vec(), 1, 0)
}

/// All are well; each change is put on top, from 1 s on for so long.
fn live(sut: &mut Executive, ms: u64, change: impl Fn(&mut [Signs; 3], u64)) -> Vec<Finding> {
    let mut found = Vec::new();
    for now_ns in (0..1000 + ms).step_by(5).map(|ms| ms * MS) {
        let sent = now_ns / (100 * MS);
        let stage = Signs {
            up: true,
            processes: 1,
            life: 1,
            heartbeat_ns: now_ns,
            offered: Some(sent),
            offerer: 1,
            taken: sent,
            parts: sent,
            ..Signs::default()
        };
        let mut signs = [Signs { offered: None, ..stage }, stage, stage];
        sut.feed(now_ns, (Watch::MarginPct, None), 80.0);
        sut.feed(now_ns, (Watch::DropRatio, None), 0.0);
        for place in 0..3 {
            sut.feed(now_ns, (Watch::RssMib, Some(place)), 20.0);
            sut.feed(now_ns, (Watch::OpenFiles, Some(place)), 20.0);
        }
        if now_ns >= 1000 * MS {
            change(&mut signs, now_ns);
        }
        found.extend(sut.look(now_ns, &signs, FLOW));
    }
    found
}

fn stop(signs: &mut [Signs; 3], place: usize) {
    signs[place].heartbeat_ns = 1000 * MS;
    signs[place].taken = 10;
    signs[place].parts = 10;
    signs[place].activity = Some(Activity { stopped: true, ..Activity::default() });
}

#[test]
fn a_chain_that_is_well_has_no_findings() {
    assert_eq!(live(&mut sut(&table(&[])), 20_000, |_, _| ()), []);
}

#[test]
fn only_the_sick_stage_is_named_and_restarted_after_its_time() {
    let mut sut = sut(&table(&[]));
    let found = live(&mut sut, 3_000, |signs, _| {
        stop(signs, 1);
        // The one after gets nothing more.
        (signs[2].offered, signs[2].taken) = (Some(10), 10);
    });
    let [Finding::Began(1, Condition::Hung, _), Finding::Do(order)] = &found[..] else { panic!("{found:?}") };
    assert_eq!(
        (order.action, order.stage, order.reason.as_str()),
        (Action::RestartStage, Some(1), "clusterer is hung")
    );
    assert_eq!(sut.condition(1), Some(Condition::Hung));
    assert_eq!(sut.condition(2), None);
}

#[test]
fn half_a_second_of_standstill_is_said_and_nothing_is_done() {
    let found = live(&mut sut(&table(&[])), 3_000, |signs, now_ns| {
        if now_ns < 1_500 * MS {
            stop(signs, 1);
        }
    });
    assert!(matches!(found[..], [Finding::Began(1, Condition::Hung, _), Finding::Ended(1, Condition::Hung, _)]));
}

#[test]
fn a_death_is_told_and_its_restart_left_to_those_who_settle_it() {
    let die = |signs: &mut [Signs; 3], _: u64| signs[1].up = false;
    let found = live(&mut sut(&table(&[])), 500, die);
    assert!(matches!(found[..], [Finding::Began(1, Condition::Dead, _)]), "{found:?}");
    let safe = table(&[("when = \"dead\"\nthen = \"restart-stage\"", "when = \"dead\"\nthen = \"safe\"")]);
    let found = live(&mut sut(&safe), 500, die);
    let [_, Finding::Do(order)] = &found[..] else { panic!("{found:?}") };
    assert_eq!((order.action, order.reason.as_str()), (Action::Safe, "clusterer is dead"));
}

#[test]
fn the_other_table_counts_from_its_look_on() {
    let mut sut = sut(&table(&[]));
    sut.replace(&table(&[("after_ms = 1000.0\nthen = \"restart-stage\"", "after_ms = 100.0\nthen = \"safe\"")]), 0);
    let found = live(&mut sut, 500, |signs, _| stop(signs, 1));
    assert!(matches!(&found[..], [_, Finding::Do(order)] if order.action == Action::Safe), "{found:?}");
}

#[test]
fn a_limit_is_told_with_its_numbers_and_its_order_with_its_process() {
    let mut sut = sut(&table(&[]));
    for second in 1..=5 {
        sut.feed(second, (Watch::RssMib, Some(2)), 600.0);
    }
    let found = sut.look(6, &[], FLOW);
    let [Finding::Limit(change)] = &found[..] else { panic!("{found:?}") };
    let order = sut.order_of(change).unwrap();
    assert_eq!((order.action, order.stage), (Action::RestartStage, Some(2)));
    assert_eq!(order.reason, "limit \"memory\": rss_mib is 600.000, at most 512");
}

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::campaign::{Campaign, Kind, Random, Spacing};
use crate::catalogue::Unit;
use crate::planned::Planned;

/// The faults of a campaign within `duration_s`, by time. The same campaign and seed give the same list, and a longer one
/// begins with a shorter one's, but for those that fall into the shorter one's quiet end.
pub fn schedule(campaign: &Campaign, seed: u64, duration_s: f64) -> Vec<Planned> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let script = campaign.script.iter().filter(|planned| planned.at_s <= duration_s);
    let mut all: Vec<Planned> =
        script.map(|planned| Planned { seed: rng.next_u32().into(), ..planned.clone() }).collect();
    if let Some(random) = &campaign.random {
        // A stream of its own: how long the script is changes nothing here.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1);
        draw(random, &mut rng, duration_s, &mut all);
    }
    all.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
    all
}

fn draw(random: &Random, rng: &mut ChaCha8Rng, duration_s: f64, all: &mut Vec<Planned>) {
    let mut at_s = random.after_s;
    loop {
        at_s += match random.spacing {
            Spacing::Fixed => random.every_s,
            // Never 0, so that the logarithm is finite.
            Spacing::Poisson => -(1.0 - rng.random::<f64>()).ln() * random.every_s,
        };
        if at_s.is_nan() || at_s > duration_s - random.quiet_s {
            return;
        }
        all.extend(pick(&random.kinds, rng).map(|kind| planned(kind, rng, at_s)));
    }
}

/// One of the kinds, by their weights.
fn pick<'a>(kinds: &'a [Kind], rng: &mut ChaCha8Rng) -> Option<&'a Kind> {
    let sum: f64 = kinds.iter().map(|kind| kind.weight).sum();
    let mut place = rng.random::<f64>() * sum;
    let weighty = || kinds.iter().filter(|kind| kind.weight > 0.0);
    let found = weighty().find(|kind| {
        place -= kind.weight;
        place < 0.0
    });
    found.or(weighty().next_back())
}

fn planned(kind: &Kind, rng: &mut ChaCha8Rng, at_s: f64) -> Planned {
    // Always drawn, so that what one kind needs changes nothing for those after it.
    let [stage, by, for_s, times] = [(); 4].map(|()| rng.random::<f64>());
    let seed = rng.next_u32().into();
    let stage = kind.stages.get((stage * kind.stages.len() as f64) as usize).or(kind.stages.last()).cloned();
    let mut planned = Planned::usual(kind.fault, thousandths(at_s), stage, seed);
    let between = |[from, to]: [f64; 2], place: f64| thousandths(from + (to - from) * place).clamp(from, to);
    let whole = |[from, to]: [f64; 2], place: f64| (from + ((to - from + 1.0) * place).floor()).min(to);
    if let Some(ends) = kind.by {
        let counted = kind.fault.entry().strength.is_some_and(|strength| strength.unit == Unit::Count);
        planned.argument = Some(if counted { whole(ends, by) } else { between(ends, by) });
    }
    if let Some(ends) = kind.for_s {
        planned.for_s = Some(between(ends, for_s));
    }
    if let Some(ends) = kind.times {
        planned.times = Some(whole(ends.map(|end| end as f64), times) as u64);
    }
    planned
}

/// Nobody needs more digits, and JSON gives these back as they were.
fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        [random]
        every_s = 60.0
        spacing = "poisson"
        after_s = 30.0
        quiet_s = 30.0
        [[fault]]
        name = "kill"
        weight = 3.0
        stages = ["clusterer", "extractor"]
        [[fault]]
        name = "stop"
        weight = 1.0
        stages = ["recorder"]
        for_s = [0.1, 10.0]
        [[fault]]
        name = "dust"
        weight = 1.0
        by = [1, 3]
        times = [1, 20]
        [[fault]]
        name = "swallow"
        weight = 0.0
        stages = ["source"]
        [[script]]
        at_s = 5.0
        fault = "kill-all"
    "#;

    const WRITTEN_DOWN: [&str; 4] = [
        "5 kill-all --seed 601310139",
        "320.52 kill extractor --seed 2704516771",
        "399.233 kill extractor --seed 174181456",
        "444.829 kill extractor --seed 1311545980",
    ];

    #[test]
    fn the_same_seed_gives_the_same_list_and_another_one_another() {
        let campaign = Campaign::parse(TEXT).unwrap();
        let list = schedule(&campaign, 7, 36_000.0);
        assert_eq!(list, schedule(&Campaign::parse(TEXT).unwrap(), 7, 36_000.0));
        assert_ne!(list, schedule(&campaign, 8, 36_000.0));
        // Its beginning was written down once: it must be the same in every build.
        let first: Vec<String> =
            list[..4].iter().map(|p| format!("{} {}", p.at_s, p.command_line().join(" "))).collect();
        assert_eq!(first, WRITTEN_DOWN);
        let text = serde_json::to_string(&list).unwrap();
        let read: Vec<Planned> = serde_json::from_str(&text).unwrap();
        assert!(read == list, "what is written is read as it was");
    }

    #[test]
    fn a_longer_campaign_begins_like_a_shorter_one() {
        let campaign = Campaign::parse(TEXT).unwrap();
        let (short, long) = (schedule(&campaign, 7, 3_600.0), schedule(&campaign, 7, 7_200.0));
        assert_eq!(short[..], long[..short.len()]);
    }

    #[test]
    fn faults_come_about_as_often_and_as_weighted_and_within_their_bounds() {
        let campaign = Campaign::parse(TEXT).unwrap();
        let list = schedule(&campaign, 1, 600_000.0);
        // 10,000 expected, with a standard deviation of 100.
        assert!((9_600..10_400).contains(&list.len()), "{}", list.len());
        let named = |name: &str| list.iter().filter(|planned| planned.fault.name() == name).count() as f64;
        let kills = named("kill") / list.len() as f64;
        assert!((0.57..0.63).contains(&kills), "{kills}");
        assert_eq!(named("swallow"), 0.0);
        assert!(list[1..].iter().all(|planned| planned.at_s > 30.0 && planned.at_s <= 599_970.0));
        assert!(list.windows(2).all(|pair| pair[0].at_s <= pair[1].at_s));
        for planned in &list {
            assert_eq!(planned.clone().checked().as_ref(), Ok(planned));
        }
        let dust: Vec<_> = list.iter().filter(|planned| planned.fault.name() == "dust").collect();
        for level in [1.0, 2.0, 3.0] {
            assert!(dust.iter().any(|planned| planned.argument == Some(level)));
        }
        assert!(dust.iter().any(|planned| planned.times == Some(20)) && dust.iter().any(|p| p.times == Some(1)));
    }

    #[test]
    fn fixed_times_are_so_far_apart() {
        let campaign = Campaign::parse(&TEXT.replace("poisson", "fixed")).unwrap();
        let at_s: Vec<f64> = schedule(&campaign, 7, 240.0).iter().map(|planned| planned.at_s).collect();
        assert_eq!(at_s, [5.0, 90.0, 150.0, 210.0]);
    }
}

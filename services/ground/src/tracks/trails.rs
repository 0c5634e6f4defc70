//! The courses of one scene seen from above: truth, tracks, and where numbers change.

use std::collections::BTreeMap;
use std::fmt::Write;

use messages::Track;

use super::clear_mot::ClearMot;
use super::frame::{Frame, Looked, is_believed};
use crate::paper::svg::{APART, dot, open, shape, text};

/// Side of the picture \[px\].
const SIDE_PX: f64 = 1_000.0;

/// Beyond so many tracks, their numbers would cover each other.
const MOST_NUMBERS: usize = 100;

/// One place in two is drawn.
const STRIDE: usize = 2;

/// Courses seen from above \[m\], by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Trails {
    /// Stretches with enough returns, and those with fewer.
    seen: BTreeMap<u16, Vec<Vec<[f64; 2]>>>,
    hidden: BTreeMap<u16, Vec<Vec<[f64; 2]>>>,
    tracks: BTreeMap<u64, Vec<[f64; 2]>>,
    /// Where an obstacle goes on under another number.
    switches: Vec<[f64; 2]>,
    /// Obstacles of the last sweep that count and have no track.
    missed: Vec<[f64; 2]>,
}

impl Trails {
    pub(crate) fn of(sweeps: &[Looked], least_returns: u32, match_m: f64) -> Self {
        let mut trails = Self::default();
        let frames: Vec<Frame> = sweeps.iter().map(|looked| Frame::of(looked, least_returns, match_m)).collect();
        let (_, matches) = ClearMot::of(&frames, match_m);
        let mut held: BTreeMap<u16, u64> = BTreeMap::new();
        let mut was_seen: BTreeMap<u16, bool> = BTreeMap::new();
        for (place, ((looked, frame), matches)) in sweeps.iter().zip(&frames).zip(&matches).enumerate() {
            let is_last = place + 1 == sweeps.len();
            for actual in &looked.actual {
                let (at, is_seen) = ([actual.centre_m.x, actual.centre_m.y], actual.returns >= least_returns);
                let row = frame.actual.iter().position(|&id| id == actual.id);
                let found = matches.iter().find(|pair| Some(pair.0) == row);
                if let Some(&(_, column)) = found {
                    let id = frame.claimed[column];
                    if held.insert(actual.id, id).is_some_and(|before| before != id) {
                        trails.switches.push(at);
                    }
                } else if is_last && is_seen {
                    trails.missed.push(at);
                }
                let list = if is_seen { &mut trails.seen } else { &mut trails.hidden };
                let stretches = list.entry(actual.id).or_default();
                if was_seen.insert(actual.id, is_seen) != Some(is_seen) {
                    stretches.push(Vec::new());
                }
                if let Some(stretch) =
                    stretches.last_mut().filter(|list| place % STRIDE == 0 || list.is_empty() || is_last)
                {
                    stretch.push(at);
                }
            }
            for track in looked.tracks.iter().filter(|track| is_believed(track)) {
                if place % STRIDE == 0 || is_last || !trails.tracks.contains_key(&track.id) {
                    trails.note(track);
                }
            }
        }
        trails
    }

    /// Adds where a track is.
    pub(crate) fn note(&mut self, track: &Track) {
        let [x, y, _] = track.position_m.map(f64::from);
        self.tracks.entry(track.id).or_default().push([x, y]);
    }

    /// Distance to each side that the picture shows \[m\]: that of the obstacles; of the tracks, where no obstacles are known.
    fn far_m(&self) -> f64 {
        let obstacles = || self.seen.values().chain(self.hidden.values()).flatten().flatten();
        let far_m = match obstacles().next() {
            Some(_) => obstacles().flatten().map(|one| one.abs()).fold(5.0, f64::max),
            None => self.tracks.values().flatten().flatten().map(|one| one.abs()).fold(5.0, f64::max),
        };
        far_m.min(60.0)
    }

    /// The picture as SVG.
    pub(crate) fn svg(&self) -> String {
        let far_m = self.far_m();
        let scale = 0.49 * SIDE_PX / far_m;
        let place = |at: [f64; 2]| [0.5 * SIDE_PX + scale * at[0], 0.5 * SIDE_PX - scale * at[1]];
        let line = |svg: &mut String, points: &[[f64; 2]], style: &str| {
            let points: Vec<_> = points.iter().map(|&at| place(at)).collect();
            shape(svg, "polyline", &points, &format!(r#"fill="none" {style}"#));
        };
        let mut svg = open(SIDE_PX, SIDE_PX, "courses of obstacles and tracks seen from above");
        for tick in (1..).map(|tick| 10.0 * f64::from(tick)).take_while(|&radius_m| radius_m < far_m) {
            let radius = scale * tick;
            // Writing to a string cannot fail.
            let _ = write!(
                svg,
                r##"<circle cx="{0}" cy="{0}" r="{radius:.1}" fill="none" stroke="#e4e4e4"/>"##,
                0.5 * SIDE_PX
            );
            text(&mut svg, [0.5 * SIDE_PX + radius + 3.0, 0.5 * SIDE_PX + 12.0], "start", 11, &format!("{tick} m"));
        }
        for stretch in self.hidden.values().flatten() {
            line(&mut svg, stretch, r##"stroke="#cfcfcf" stroke-width="2" stroke-dasharray="2 4""##);
        }
        for stretch in self.seen.values().flatten() {
            line(&mut svg, stretch, r##"stroke="#bdbdbd" stroke-width="7" stroke-linecap="round""##);
        }
        for (number, (id, trail)) in self.tracks.iter().enumerate() {
            let colour = APART[number % APART.len()];
            line(&mut svg, trail, &format!(r#"stroke="{colour}" stroke-width="1.6""#));
            if let Some(&last) = trail.last() {
                let [x, y] = place(last);
                let _ = write!(svg, r#"<g fill="{colour}">"#);
                dot(&mut svg, [x, y], 2.6);
                if self.tracks.len() <= MOST_NUMBERS {
                    let (beside, anchor) = if x > SIDE_PX - 50.0 { (x - 5.0, "end") } else { (x + 5.0, "start") };
                    text(&mut svg, [beside, (y - 4.0).max(11.0)], anchor, 11, &id.to_string());
                }
                svg.push_str("</g>");
            }
        }
        let ring = |svg: &mut String, at: [f64; 2], style: &str| {
            let [x, y] = place(at);
            let _ = write!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="8" fill="none" {style}/>"#);
        };
        for &at in &self.switches {
            ring(&mut svg, at, r##"stroke="#c8322b" stroke-width="2""##);
        }
        for &at in &self.missed {
            ring(&mut svg, at, r##"stroke="#222" stroke-width="1.5" stroke-dasharray="3 2""##);
        }
        let _ = write!(svg, r##"<path d="M{0} {1}h12m-6-6v12" stroke="#222"/>"##, 0.5 * SIDE_PX - 6.0, 0.5 * SIDE_PX);
        svg + "</svg>"
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn courses_switches_and_what_is_missed_are_drawn() {
        let sweeps: Vec<Looked> = (0..9)
            .map(|sweep| {
                let x = f64::from(sweep);
                let near = [x, 1.0, 0.0];
                Looked {
                    actual: vec![actual(1, near, if sweep == 5 { 0 } else { 9 }), actual(2, [x, -5.0, 0.0], 9)],
                    tracks: vec![track(if sweep < 4 { 77 } else { 78 }, near)],
                }
            })
            .collect();
        let sut = Trails::of(&sweeps, 5, 2.0);
        assert_eq!((sut.switches.len(), sut.missed.len()), (1, 1));
        assert_eq!((sut.seen[&1].len(), sut.hidden[&1].len(), sut.seen[&2].len()), (2, 1, 1));
        assert_eq!(sut.tracks.keys().collect::<Vec<_>>(), [&77, &78]);
        let svg = sut.svg();
        assert!(svg.contains(">78<") && svg.matches("<polyline").count() == 6, "{svg}");
        assert!(Trails::default().svg().ends_with("</svg>"));
    }

    #[test]
    fn numbers_at_the_rim_stay_in_the_picture_and_of_too_many_there_are_none() {
        let mut sut = Trails::default();
        for (id, at_m) in [(41, [30.0, 0.0, 0.0]), (42, [0.0, 30.0, 0.0])] {
            sut.note(&track(id, at_m));
        }
        let svg = sut.svg();
        assert!(svg.contains(r#"text-anchor="end" font-size="11">41<"#), "{svg}");
        assert!(svg.contains(r#"y="11.0" text-anchor="start" font-size="11">42<"#), "{svg}");
        (100..=200).for_each(|id| sut.note(&track(id, [1.0, 2.0, 0.0])));
        assert!(!sut.svg().contains(">41<"));
    }
}

use nalgebra::{Rotation3, Vector3};

use super::budget::Purse;
use super::residuals::{Measure, Parts, Rays, measure};
use super::solid::for_kind;
use super::system::{MOST, System};
use super::{Body, Kind, UnitSolid};

/// Longest step in one parameter: metres, radians, ln.
const LONGEST: f64 = 0.5;
/// Bounds of ln of a half extent: 8 cm and 5 m.
const LN_HALF: [f64; 2] = [-2.5, 1.6];
/// Dampings tried before a minimum counts as reached.
const TRIES: usize = 4;

/// A body on its way to a minimum, by Levenberg's and Marquardt's method (Levenberg 1944, Marquardt 1963).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Descent {
    pub(crate) kind: Kind,
    pub(crate) body: Body,
    pub(crate) system: System,
    pub(crate) parts: Parts,
    damping: f64,
    settled: bool,
}

impl Descent {
    /// Stands at `body`.
    pub(crate) fn at(kind: Kind, body: Body, rays: &Rays<'_>, how: Measure, purse: &mut Purse) -> Self {
        purse.owe(rays.count());
        let (system, parts) = for_kind!(kind, S => measure::<S>(&body, rays, how, f64::INFINITY));
        Self { kind, body, system, parts, damping: 1e-2, settled: false }
    }

    /// Takes at most `steps` steps downhill, fewer where the minimum or the end of the budget is reached.
    pub(crate) fn run(&mut self, rays: &Rays<'_>, how: Measure, steps: usize, purse: &mut Purse) {
        for _ in 0..steps {
            if self.settled {
                return;
            }
            for_kind!(self.kind, S => self.step::<S>(rays, how, purse));
        }
    }

    pub(crate) fn cost(&self) -> f64 {
        self.system.cost
    }

    fn step<S: UnitSolid>(&mut self, rays: &Rays<'_>, how: Measure, purse: &mut Purse) {
        for _ in 0..TRIES {
            let Some(step) = self.system.step(S::ROUND, self.damping) else { break };
            if !purse.pay(rays.count()) {
                break;
            }
            let body = moved::<S>(&self.body, &step);
            let (system, parts) = measure::<S>(&body, rays, how, self.system.cost);
            let gain = self.system.cost - system.cost;
            if gain > 0.0 {
                self.settled = gain < 1e-3 * system.cost + 1e-6;
                (self.body, self.system, self.parts) = (body, system, parts);
                self.damping = (self.damping / 8.0).max(1e-6);
                return;
            }
            self.damping *= 6.0;
        }
        self.settled = true;
    }
}

/// The body less a step.
pub(crate) fn moved<S: UnitSolid>(body: &Body, step: &[f64; MOST]) -> Body {
    let s = step.map(|c| c.clamp(-LONGEST, LONGEST));
    let shift = Vector3::new(s[0], s[1], s[2]);
    let (turn, growth) = if S::ROUND {
        (Vector3::new(s[3], s[4], 0.0), Vector3::new(s[5], s[5], s[6]))
    } else {
        (Vector3::new(s[3], s[4], s[5]), Vector3::new(s[6], s[7], s[8]))
    };
    Body {
        centre_m: body.centre_m - body.rotation * shift,
        rotation: body.rotation * Rotation3::new(-turn).into_inner(),
        ln_half: (body.ln_half - growth).map(|l| l.clamp(LN_HALF[0], LN_HALF[1])),
    }
}

//! Sweeps as a sensor in trouble, or a broken driver, would give them.
//!
//! Each corruption is a function of the sweep, its strength and a seed. What comes out is a sweep again: lengths, counts and
//! indices agree, returns lie in columns that were received, and nobody promises more of it than before (whoever cuts it
//! measures it anew).

mod beams;
mod blur;
mod crosstalk;
mod dust;
mod echoes;
mod incomplete;
mod odd;

use messages::{Sweep, Truth};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::Fault;
use echoes::Echoes;

/// Spoils sweeps. Allocates with the first one that it spoils: 3.5 MB.
#[derive(Default)]
pub struct Corruptor {
    echoes: Echoes,
}

impl Corruptor {
    /// Spoils a sweep, and what is known of it, by `fault` at a `level` of 1 to 3. `number` tells the sweeps of one `seed`
    /// apart. A fault that is none of a single sweep's contents changes nothing.
    pub fn corrupt(
        &mut self,
        fault: Fault,
        level: u32,
        (seed, number): (u64, u64),
        sweep: &mut Sweep,
        truth: &mut Truth,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number.wrapping_add(1));
        let echoes = &mut self.echoes;
        echoes.load(sweep, truth);
        match fault {
            // The same beams in every sweep: no stream of the sweep's own.
            Fault::BeamsMissing => beams::lose(echoes, level, sweep, &mut ChaCha8Rng::seed_from_u64(seed)),
            Fault::Crosstalk => crosstalk::mix(echoes, level, &mut rng),
            Fault::Dust => dust::raise(echoes, level, sweep, &mut rng),
            Fault::MotionBlur => blur::smear(echoes, level, sweep, &mut rng),
            Fault::IncompleteEcho => incomplete::weaken(echoes, level, &mut rng),
            Fault::EmptySweep => echoes.list.clear(),
            Fault::OnePoint => odd::keep_one(echoes, &mut rng),
            Fault::AllNan => odd::forget_numbers(echoes),
            Fault::DuplicatePoints => odd::double(echoes),
            Fault::GiantCluster => odd::surround(echoes, sweep),
            Fault::OversizedSweep => odd::overfill(echoes, sweep, &mut rng),
            _ => return,
        }
        echoes.store(sweep, truth);
    }
}

/// Of three values the one of a level of 1 to 3; the nearest beyond.
fn by_level<T: Copy>(values: [T; 3], level: u32) -> T {
    values[level.clamp(1, 3) as usize - 1]
}

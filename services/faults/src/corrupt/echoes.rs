use lidar::{MAX_COLUMNS, MAX_RETURNS, Return};
use messages::{NO_OBJECT, Refusal, Sweep, Truth};

/// A return and whose it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    pub(super) r: Return,
    pub(super) owner: u16,
}

impl Echo {
    /// One that lies on nothing.
    pub(super) fn of_nothing(r: Return) -> Self {
        Self { r, owner: NO_OBJECT }
    }

    /// Moves it to a range, where it has a direction.
    pub(super) fn set_range_m(&mut self, range_m: f32) {
        let factor = range_m / self.r.range_m();
        if factor.is_finite() {
            (self.r.x, self.r.y, self.r.z) = (self.r.x * factor, self.r.y * factor, self.r.z * factor);
        }
    }
}

/// The returns of a sweep as a list that may grow and shrink.
#[derive(Default)]
pub(super) struct Echoes {
    pub(super) list: Vec<Echo>,
    /// For each column the rings that gave a return, as bits.
    fired: Vec<u64>,
}

impl Echoes {
    /// Takes the returns out of a sweep and its truth.
    pub(super) fn load(&mut self, sweep: &Sweep, truth: &Truth) {
        self.list.clear();
        self.list.reserve(MAX_RETURNS + 1);
        let owner = |place: usize| truth.owners.get(place).copied().unwrap_or(NO_OBJECT);
        self.list.extend(sweep.returns.iter().enumerate().map(|(place, &r)| Echo { r, owner: owner(place) }));
    }

    /// Puts the returns back: those that fit are the first recorded ones, in their order; the others are refused.
    pub(super) fn store(&mut self, sweep: &mut Sweep, truth: &mut Truth) {
        let fit = self.list.len().min(MAX_RETURNS);
        let beyond = self.list.len() - fit;
        let known = !truth.owners.is_empty();
        sweep.header.refused[Refusal::OverCapacity as usize] += beyond as u32;
        let refused: u32 = sweep.header.refused.iter().sum();
        sweep.header.recorded = fit as u32 + refused;
        sweep.first_return = 0;
        sweep.returns.clear();
        sweep.recorded_index.clear();
        truth.owners.clear();
        truth.objects.iter_mut().for_each(|object| object.returns = 0);
        for (place, echo) in self.list[..fit].iter().enumerate() {
            // There is room: no more than fit.
            let _ = sweep.returns.push(echo.r);
            if refused > 0 {
                let _ = sweep.recorded_index.push(place as u32);
            }
            if known {
                let _ = truth.owners.push(echo.owner);
                if let Some(object) = truth.objects.get_mut(usize::from(echo.owner)) {
                    object.returns += 1;
                }
            }
        }
    }

    /// Remembers which firings have a return.
    pub(super) fn note_fired(&mut self) {
        self.fired.clear();
        self.fired.resize(MAX_COLUMNS, 0);
        for Echo { r, .. } in &self.list {
            if let Some(rings) = self.fired.get_mut(usize::from(r.column)) {
                *rings |= bit(r.ring);
            }
        }
    }

    /// Whether a firing had a return when that was noted.
    pub(super) fn has_fired(&self, column: u16, ring: u8) -> bool {
        self.fired.get(usize::from(column)).is_some_and(|rings| rings & bit(ring) != 0)
    }

    /// Puts an organised sweep's returns in firing order again.
    pub(super) fn sort(&mut self, sweep: &Sweep) {
        let fired_ns = |ring: u8| sweep.rings.get(usize::from(ring)).map_or(0, |ring| ring.offset_ns);
        self.list.sort_by_key(|echo| (echo.r.column, fired_ns(echo.r.ring), echo.r.ring));
    }
}

fn bit(ring: u8) -> u64 {
    1_u64.checked_shl(ring.into()).unwrap_or(0)
}

/// The firings of an organised sweep whose columns were received, with their unit vectors, in the order of columns, then
/// rings; none in an unorganised sweep.
pub(super) fn firings(sweep: &Sweep) -> impl Iterator<Item = (u16, u8, [f32; 3])> + '_ {
    let received = sweep.columns.iter().enumerate().filter(|(_, column)| column.valid != 0);
    received.flat_map(move |(column, at)| {
        let (sin, cos) = at.azimuth_rad.sin_cos();
        sweep.rings.iter().enumerate().map(move |(ring, beam)| {
            let (up, flat) = beam.elevation_rad.sin_cos();
            (column as u16, ring as u8, [flat * cos, flat * sin, up])
        })
    })
}

/// A return in a direction.
pub(super) fn at((column, ring, direction): (u16, u8, [f32; 3]), range_m: f32, intensity: u8) -> Return {
    let [x, y, z] = direction.map(|along| along * range_m);
    Return { x, y, z, column, ring, intensity }
}

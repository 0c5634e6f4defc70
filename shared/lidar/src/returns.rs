use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// One echo of one firing, 16 bytes. Position in metres, sensor frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Return {
    /// Forward [m].
    pub x: f32,
    /// Left [m].
    pub y: f32,
    /// Up, along the spin axis [m].
    pub z: f32,
    /// Index of the column in the whole sweep (not in its sector); 0 in an unorganised sweep.
    pub column: u16,
    /// Beam index, 0 = lowest elevation; 0 in an unorganised sweep.
    pub ring: u8,
    /// Reflectivity as the sensor reports it, 0 to 255.
    pub intensity: u8,
}

impl Return {
    /// Position [m], sensor frame.
    pub const fn position(&self) -> [f32; 3] {
        [self.x, self.y, self.z]
    }

    /// Distance from the sensor [m].
    pub fn range_m(&self) -> f32 {
        (self.x * self.x + self.y * self.y + self.z * self.z).sqrt()
    }
}

/// One firing cycle of all lasers.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Column {
    /// Azimuth of the column's first firing [rad], counter-clockwise from +x, in [−π, π).
    pub azimuth_rad: f32,
    /// Time of the column's first firing after the start of the sweep [ns].
    pub offset_ns: u32,
    /// 1 when the column was received. 0 means that nothing is known of it: never a row of misses.
    pub valid: u32,
}

/// One beam of the sensor, as a message carries it.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Ring {
    /// Elevation above the plane normal to the spin axis [rad].
    pub elevation_rad: f32,
    /// Time of this beam's firing after its column's first [ns].
    pub offset_ns: u32,
}

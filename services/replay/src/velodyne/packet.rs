//! A Velodyne data packet: 12 blocks of 32 channels, then stamp and factory bytes. Little-endian.

/// Length of a data packet [bytes].
pub(crate) const PACKET_BYTES: usize = 1_206;
/// Blocks of a packet.
pub(crate) const BLOCKS: usize = 12;
/// Channels of a block.
pub(crate) const CHANNELS: usize = 32;
/// Length of a block [bytes].
pub(crate) const BLOCK_BYTES: usize = 100;
/// First two bytes of a block.
pub(crate) const BLOCK_FLAG: [u8; 2] = [0xFF, 0xEE];
/// A turn [0.01°].
pub(crate) const TURN_CDEG: u16 = 36_000;
/// Stamps count from the top of the hour [µs].
pub(crate) const HOUR_US: u64 = 3_600_000_000;
/// Return modes, byte 1204.
pub(crate) const STRONGEST: u8 = 0x37;
pub(crate) const DUAL: u8 = 0x39;

const STAMP_AT: usize = BLOCKS * BLOCK_BYTES;

/// One data packet as recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet {
    pub(crate) bytes: [u8; PACKET_BYTES],
}

impl Default for Packet {
    fn default() -> Self {
        Self { bytes: [0; PACKET_BYTES] }
    }
}

impl Packet {
    fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]])
    }

    /// Whether `block` has its flag and an azimuth that can be: 36000 does occur.
    pub(crate) fn is_block(&self, block: usize) -> bool {
        let at = block * BLOCK_BYTES;
        self.bytes[at..at + 2] == BLOCK_FLAG && self.u16(at + 2) <= TURN_CDEG
    }

    /// Whether `block` is there at all: one without a flag and with an azimuth beyond the turn fills up a short packet.
    pub(crate) fn is_absent(&self, block: usize) -> bool {
        let at = block * BLOCK_BYTES;
        self.bytes[at..at + 2] != BLOCK_FLAG && self.u16(at + 2) > TURN_CDEG
    }

    /// Azimuth of `block` [0.01°], clockwise, below 36000.
    pub(crate) fn azimuth_cdeg(&self, block: usize) -> u16 {
        self.u16(block * BLOCK_BYTES + 2) % TURN_CDEG
    }

    /// Distance (two bytes) and intensity of each channel of `block`; none where it is no block.
    pub(crate) fn channels(&self, block: usize) -> Option<&[[u8; 3]; CHANNELS]> {
        let at = block * BLOCK_BYTES + 4;
        let (channels, _) = self.bytes.get(at..at + 3 * CHANNELS)?.as_chunks();
        channels.first_chunk().filter(|_| self.is_block(block))
    }

    /// Distance in counts (0 = no return, whatever the intensity) and intensity of a channel.
    pub(crate) fn channel(&self, block: usize, channel: usize) -> (u16, u8) {
        let at = block * BLOCK_BYTES + 4 + 3 * channel;
        (self.u16(at), self.bytes[at + 2])
    }

    /// Microseconds since the top of the hour.
    pub(crate) fn stamp_us(&self) -> u64 {
        u64::from(self.u16(STAMP_AT)) | u64::from(self.u16(STAMP_AT + 2)) << 16
    }

    /// Return mode; without meaning in old firmware.
    pub(crate) fn return_mode(&self) -> u8 {
        self.bytes[STAMP_AT + 4]
    }

    /// Factory byte of the sensor's kind; other content in very old firmware.
    pub(crate) fn product_id(&self) -> u8 {
        self.bytes[STAMP_AT + 5]
    }

    /// Whether blocks come in pairs of equal azimuth, the last returns before the strongest.
    pub(crate) fn is_dual(&self) -> bool {
        // Old firmware has other content in the mode's byte, so the pairs decide too.
        self.return_mode() == DUAL
            && (0..BLOCKS).step_by(2).all(|even| {
                !(self.is_block(even) && self.is_block(even + 1))
                    || self.azimuth_cdeg(even) == self.azimuth_cdeg(even + 1)
            })
    }

    pub(crate) fn set_block(&mut self, block: usize, flag: [u8; 2], azimuth_cdeg: u16) {
        let at = block * BLOCK_BYTES;
        self.bytes[at..at + BLOCK_BYTES].fill(0);
        self.bytes[at..at + 2].copy_from_slice(&flag);
        self.bytes[at + 2..at + 4].copy_from_slice(&azimuth_cdeg.to_le_bytes());
    }

    pub(crate) fn set_channel(&mut self, block: usize, channel: usize, distance: u16, intensity: u8) {
        let at = block * BLOCK_BYTES + 4 + 3 * channel;
        self.bytes[at..at + 2].copy_from_slice(&distance.to_le_bytes());
        self.bytes[at + 2] = intensity;
    }

    pub(crate) fn set_end(&mut self, stamp_us: u32, mode: u8, product: u8) {
        self.bytes[STAMP_AT..STAMP_AT + 4].copy_from_slice(&stamp_us.to_le_bytes());
        self.bytes[STAMP_AT + 4] = mode;
        self.bytes[STAMP_AT + 5] = product;
    }
}

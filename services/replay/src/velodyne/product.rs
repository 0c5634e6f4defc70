//! What the factory byte of a data packet says of its sensor.

/// Product ids of the sensors whose models come with the program; HDL-32E User's Manual, VLP-32C User Manual, table 9-1.
const SENSORS: [(u8, &str); 3] = [(0x21, "hdl-32e"), (0x22, "vlp-16"), (0x28, "vlp-32c")];
/// Puck Hi-Res, VLP-32A and B, Velarray, VLS-128 in older and newer firmware: packets of sensors without a model here.
const OTHERS: [u8; 5] = [0x24, 0x23, 0x31, 0x63, 0xA1];
const HDL_32E: u8 = 0x21;
const VLP_16: u8 = 0x22;

/// The sensor model that goes with a product id; none for an id of others, or of very old firmware, which has other
/// content in that byte.
pub(crate) fn sensor_of(product_id: u8) -> Option<&'static str> {
    SENSORS.iter().find(|(id, _)| *id == product_id).map(|(_, name)| *name)
}

/// What a product id says, in words.
pub(crate) fn name_of(product_id: u8) -> String {
    let name = sensor_of(product_id).unwrap_or("a sensor that has no model here");
    format!("{name} (factory byte {product_id:#04x})")
}

/// Whether a packet says that it is from another sensor than `expected`. Early VLP-16 carry the HDL-32E's id, and an
/// unknown one says nothing.
pub(crate) fn is_of_another(product_id: u8, expected: u8) -> bool {
    let is_known = sensor_of(product_id).is_some() || OTHERS.contains(&product_id);
    is_known && product_id != expected && !(expected == VLP_16 && product_id == HDL_32E)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_known_id_can_contradict_and_an_early_vlp_16_does_not() {
        assert_eq!(sensor_of(0x28), Some("vlp-32c"));
        assert_eq!(sensor_of(0x00), None);
        assert_eq!(name_of(0x22), "vlp-16 (factory byte 0x22)");
        assert_eq!(name_of(0xA1), "a sensor that has no model here (factory byte 0xa1)");
        assert!(is_of_another(0x28, HDL_32E) && is_of_another(0xA1, HDL_32E) && is_of_another(HDL_32E, 0x28));
        assert!(!is_of_another(0x00, HDL_32E) && !is_of_another(HDL_32E, VLP_16) && !is_of_another(0x28, 0x28));
    }
}

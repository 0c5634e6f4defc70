//! Clouds of others in MCAP files, real and made.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use support::{all, assert_true, data, opened};

#[test]
fn explore() {
    let (Some(mcap), Some(pcap)) = (data("mcap/monterey_hdl32e_pointcloud2.mcap"), data("hdl32e/monterey_hdl32e.pcap")) else { return };
    let found = all(&mut opened(&mcap).unwrap());
    let truth = all(&mut opened(&pcap).unwrap());
    for (a, b) in found.iter().zip(&truth[4..]) {
        assert_true(a);
        println!("{:?}\n{:?}", a.header, b.header);
        println!("{} {} cols {} {}", a.returns.len(), b.returns.len(), a.columns.len(), b.columns.len());
        let mut bit = 0; let mut worst = 0f32; let mut cols = 0; let mut rings = 0; let mut ints = 0;
        for (x, y) in a.returns.iter().zip(&b.returns) {
            bit += usize::from(x.position() == y.position());
            for i in 0..3 { worst = worst.max((x.position()[i]-y.position()[i]).abs()); }
            cols += usize::from(x.column == y.column);
            rings += usize::from(x.ring == y.ring);
            ints += usize::from(x.intensity == y.intensity);
        }
        println!("bit {bit} worst {worst} cols {cols} rings {rings} ints {ints}");
    }
}

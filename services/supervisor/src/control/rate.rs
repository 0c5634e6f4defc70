/// How many commands are taken: so many at once, then so many a second.
pub(crate) struct Rate {
    per_s: u32,
    /// Host time that the commands taken so far use up [ns].
    used_up_to_ns: u64,
}

impl Rate {
    pub(crate) fn per_s(per_s: u32) -> Self {
        Self { per_s: per_s.max(1), used_up_to_ns: 0 }
    }

    /// Whether one more may be taken at host time `now_ns`; if so it counts.
    pub(crate) fn allow(&mut self, now_ns: u64) -> bool {
        const SECOND_NS: u64 = 1_000_000_000;
        let each_ns = SECOND_NS / u64::from(self.per_s);
        let used = self.used_up_to_ns.max(now_ns) + each_ns;
        let allowed = used <= now_ns + SECOND_NS;
        if allowed {
            self.used_up_to_ns = used;
        }
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_takes_so_many_and_not_one_more() {
        let mut sut = Rate::per_s(50);
        let taken = |sut: &mut Rate, now_ns| (0..1_000).filter(|_| sut.allow(now_ns)).count();
        assert_eq!(taken(&mut sut, 5_000_000_000), 50);
        assert_eq!(taken(&mut sut, 5_019_000_000), 0);
        assert_eq!(taken(&mut sut, 5_020_000_000), 1);
        assert_eq!(taken(&mut sut, 5_520_000_000), 25);
        assert_eq!(taken(&mut sut, 60_000_000_000), 50, "nothing is saved up beyond a second");
    }
}

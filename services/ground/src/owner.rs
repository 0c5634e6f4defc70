use messages::{NO_OBJECT, Truth, TruthObject};

/// The obstacle that most of these returns lie on, the first of equals; none where most lie on nothing.
pub(crate) fn owner<'a>(members: &[u32], truth: &'a Truth) -> Option<&'a TruthObject> {
    let of_return = |&member: &u32| truth.owners.get(member as usize).copied().unwrap_or(NO_OBJECT);
    let mut ids: Vec<u16> = members.iter().map(of_return).collect();
    ids.sort_unstable();
    // Of runs equally long the last one found is taken: that of the smallest id.
    let most = ids.chunk_by(|a, b| a == b).rev().max_by_key(|run| run.len())?;
    let place = truth.objects.binary_search_by_key(most.first()?, |object| object.id).ok()?;
    truth.objects.get(place)
}

#[cfg(test)]
mod tests {
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn a_cluster_belongs_to_whom_most_of_its_returns_lie_on() {
        let mut truth = Truth::new_box_zeroed().unwrap();
        for id in [3, 8] {
            truth.objects.push(TruthObject { id, ..TruthObject::default() }).unwrap();
        }
        for owner in [8, 3, 8, NO_OBJECT, NO_OBJECT, NO_OBJECT] {
            truth.owners.push(owner).unwrap();
        }
        let of = |members: &[u32]| owner(members, &truth).map(|object| object.id);
        assert_eq!(of(&[0, 1, 2]), Some(8));
        assert_eq!(of(&[0, 1]), Some(3), "the first of equals");
        assert_eq!(of(&[0, 2, 3, 4, 5]), None);
        assert_eq!(of(&[0, 2, 3, 4]), Some(8), "as many lie on nothing");
        assert_eq!(of(&[6_000_000]), None, "an index of no return");
        assert_eq!(of(&[]), None);
    }
}

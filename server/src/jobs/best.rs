//! The checkpoint that renders and evaluations use: the best of those that can be compared.

use std::cmp::Ordering;
use yoto_proto::v1::Checkpoint;

/// By how much another checkpoint must be better than the newest, dB: a few held-out frames measure
/// no more exactly.
const CLEARLY: f64 = 0.1;

/// `checkpoints`, newest first, in the order in which they should be used: the best one by held-out
/// PSNR among those that know the same people and learned from pictures of the same size as the
/// newest, if it is clearly better; then the others, newest first, in case it is damaged. Training on
/// can lose quality, and the PSNR of other people or sizes says nothing.
pub fn best_first(mut checkpoints: Vec<Checkpoint>) -> Vec<Checkpoint> {
    if let Some(best) = best(&checkpoints) {
        let best = checkpoints.remove(best);
        checkpoints.insert(0, best);
    }
    checkpoints
}

/// Place of the best one; `None` without any.
fn best(checkpoints: &[Checkpoint]) -> Option<usize> {
    let newest = checkpoints.first()?;
    // An earlier version's checkpoint does not say what it can be compared with.
    if newest.slots.is_empty() {
        return Some(0);
    }
    let alike = |it: &Checkpoint| (&it.slots, it.image_size) == (&newest.slots, newest.image_size);
    let measured = checkpoints.iter().enumerate();
    let measured = measured.filter(|(_, it)| alike(it));
    let measured = measured.filter_map(|(place, it)| Some((place, it.psnr?)));
    // Of equal ones the newest.
    let best = measured.max_by(|(a, x), (b, y)| match x.total_cmp(y) {
        Ordering::Equal => b.cmp(a),
        order => order,
    });
    let clearly = |(_, psnr): &(usize, f64)| newest.psnr.is_none_or(|it| *psnr >= it + CLEARLY);
    Some(best.filter(clearly).map_or(0, |(place, _)| place))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checkpoint(step: u64, psnr: Option<f64>, slots: &[u32], image_size: u32) -> Checkpoint {
        Checkpoint {
            step,
            psnr,
            slots: slots.to_vec(),
            image_size,
            ..Checkpoint::default()
        }
    }

    fn used(checkpoints: &[Checkpoint]) -> Vec<u64> {
        let ordered = best_first(checkpoints.to_vec());
        ordered.iter().map(|it| it.step).collect()
    }

    #[test]
    fn the_best_of_the_same_people_and_size_comes_first() {
        let both = [0, 1];
        let kept = [
            checkpoint(50, Some(30.1), &both, 128),
            checkpoint(40, None, &both, 128),
            checkpoint(30, Some(30.9), &both, 128),
            checkpoint(20, Some(33.0), &both, 64),
            checkpoint(10, Some(35.0), &[0], 128),
        ];
        assert_eq!(used(&kept), [30, 50, 40, 20, 10]);
        assert_eq!(used(&kept[..2]), [50, 40]);
        assert_eq!(used(&kept[1..2]), [40], "not measured yet");
        let equal = [
            checkpoint(2, Some(30.0), &both, 128),
            checkpoint(1, Some(30.0), &both, 128),
        ];
        assert_eq!(used(&equal), [2, 1]);
        let hardly = [
            checkpoint(2, Some(30.0), &both, 128),
            checkpoint(1, Some(30.05), &both, 128),
        ];
        assert_eq!(used(&hardly), [2, 1]);
        let earlier = [
            checkpoint(2, Some(25.0), &[], 0),
            checkpoint(1, Some(35.0), &[], 0),
        ];
        assert_eq!(used(&earlier), [2, 1], "sizes are not known");
        assert!(used(&[]).is_empty());
    }
}

//! The checkpoint that renders and evaluations use: the best of those that can be compared.

use yoto_proto::v1::Checkpoint;

/// Difference by which a checkpoint must be better than a newer one, dB: a few held-out frames do not measure
/// more exactly.
const CLEARLY: f64 = 0.1;

/// Sorts `checkpoints`, which come newest first, into the order in which they should be used. First comes the
/// one with the best held-out PSNR among those trained on the same captures of the same people at the same size
/// as the newest; among nearly equal ones, the newest. Then come the others, newest first, in case the first is
/// damaged. More training can lose quality, and PSNR values on different pictures can't be compared.
pub fn best_first(mut checkpoints: Vec<Checkpoint>) -> Vec<Checkpoint> {
    if let Some(best) = best(&checkpoints) {
        let best = checkpoints.remove(best);
        checkpoints.insert(0, best);
    }
    checkpoints
}

/// The checkpoints to try for a render or an evaluation, in this order: the one with the name `wanted`, or all
/// of them if that is empty; only those with a measured trade-off where one is needed.
pub fn to_use(mut all: Vec<Checkpoint>, wanted: &str, tradeoff: bool) -> Vec<Checkpoint> {
    if wanted.is_empty() {
        all = best_first(all);
    } else {
        all.retain(|it| it.name == wanted);
    }
    // Predicted figures do not apply to a checkpoint without a measured trade-off.
    all.retain(|it| !tradeoff || it.tradeoff.is_some());
    all
}

/// Whether two checkpoints were trained on the same captures of the same people at the same size, so that their
/// figures can be compared.
pub fn alike(a: &Checkpoint, b: &Checkpoint) -> bool {
    (&a.slots, a.image_size, &a.shards) == (&b.slots, b.image_size, &b.shards)
}

/// Index of the best one; `None` without any.
fn best(checkpoints: &[Checkpoint]) -> Option<usize> {
    let newest = checkpoints.first()?;
    // An earlier version's checkpoint does not say what it can be compared with.
    if newest.slots.is_empty() {
        return Some(0);
    }
    let measured = checkpoints.iter().enumerate();
    let measured = measured.filter(|(_, it)| alike(it, newest));
    let measured = measured.filter_map(|(index, it)| Some((index, it.psnr?)));
    let measured: Vec<(usize, f64)> = measured.collect();
    let best = measured
        .iter()
        .map(|(_, psnr)| *psnr)
        .fold(f64::MIN, f64::max);
    let nearly = |(_, psnr): &&(usize, f64)| *psnr > best - CLEARLY;
    Some(measured.iter().find(nearly).map_or(0, |(index, _)| *index))
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
        // Each is hardly worse than the one before it, the newest clearly worse than the best.
        let falling = [
            checkpoint(3, Some(29.85), &both, 128),
            checkpoint(2, Some(29.95), &both, 128),
            checkpoint(1, Some(30.0), &both, 128),
        ];
        assert_eq!(used(&falling), [2, 3, 1]);
        let mut other = hardly.clone();
        other[1].psnr = Some(35.0);
        other[0].shards = vec!["another film".into()];
        assert_eq!(used(&other), [2, 1], "measured on other pictures");
        let earlier = [
            checkpoint(2, Some(25.0), &[], 0),
            checkpoint(1, Some(35.0), &[], 0),
        ];
        assert_eq!(used(&earlier), [2, 1], "sizes are not known");
        assert!(used(&[]).is_empty());
    }
}

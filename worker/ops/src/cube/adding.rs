//! Atomic sums that many threads add to. The order of the additions is not fixed, so that the last
//! bits of a gradient differ from run to run; the CPU forms are reproducible bit for bit.

use cubecl::features::AtomicUsage;
use cubecl::ir::{FloatKind, Type};
use cubecl::prelude::*;

/// The way in which a kernel adds to a float that other threads add to as well.
#[cube]
pub(crate) trait AddFloat: Send + Sync + 'static {
    /// The type that the float's four bytes are bound as.
    type Bound: Numeric;
    /// `sum += value`, atomically. Adding 0 does not touch memory.
    fn add(sum: &mut Atomic<Self::Bound>, value: f32);
}

/// The device's own atomic addition of floats.
#[derive(CubeType)]
pub(crate) struct Native;

/// Compare-and-exchange of the float's bits until no other thread interferes, for devices without atomic additions
/// of floats (SwiftShader, older mobile GPUs).
#[derive(CubeType)]
pub(crate) struct Exchanging;

#[cube]
impl AddFloat for Native {
    type Bound = f32;

    fn add(sum: &mut Atomic<f32>, value: f32) {
        if value != 0.0 {
            sum.fetch_add(value);
        }
    }
}

#[cube]
impl AddFloat for Exchanging {
    type Bound = u32;

    fn add(sum: &mut Atomic<u32>, value: f32) {
        if value != 0.0 {
            let mut current = sum.load();
            loop {
                let expected = current;
                let wanted = (f32::from_bits(expected) + value).to_bits();
                current = sum.compare_exchange_weak(expected, wanted);
                if current == expected {
                    break;
                }
            }
        }
    }
}

/// The element type that `A` binds a buffer of floats as.
pub(crate) type Bound<A> = <A as AddFloat>::Bound;

/// Whether the device has the additions of [`Native`].
pub(crate) fn adds_natively(client: &Client) -> bool {
    client
        .properties()
        .atomic_type_usage(Type::atomic(FloatKind::F32))
        .contains(AtomicUsage::Add)
}

/// Launches a kernel that is generic over [`AddFloat`], with the implementation that the device
/// can run.
macro_rules! launch_adding {
    ($kernel:ident, $client:expr, $($argument:expr),+ $(,)?) => {
        if $crate::cube::adding::adds_natively($client) {
            $kernel::launch::<$crate::cube::adding::Native>($client, $($argument),+)
        } else {
            $kernel::launch::<$crate::cube::adding::Exchanging>($client, $($argument),+)
        }
    };
}
pub(crate) use launch_adding;

use std::fmt;

use iceoryx2::prelude::ZeroCopySend;
use messages::{Message, Trace};

/// A message as iceoryx2 sees it. (Its traits cannot be implemented for our types in their own crates.)
#[repr(transparent)]
pub(crate) struct Wire<T>(pub(crate) T);

impl<T: Message> fmt::Debug for Wire<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(T::TYPE)
    }
}

// SAFETY: a `Message` is `FromZeros + Immutable + 'static` and made of bounded vectors of plain numbers: no pointer, no
// handle, `#[repr(C)]` throughout. Its type name carries the version of its layout.
#[expect(unsafe_code, reason = "iceoryx2 asks for this promise")]
unsafe impl<T: Message> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::TYPE
    }
}

/// The header beside every message.
#[derive(Clone, Copy, Debug, Default)]
#[repr(transparent)]
pub(crate) struct WireTrace(pub(crate) Trace);

// SAFETY: `Trace` is `#[repr(C)]`, made of plain numbers and one fieldless enum.
#[expect(unsafe_code, reason = "iceoryx2 asks for this promise")]
unsafe impl ZeroCopySend for WireTrace {
    unsafe fn type_name() -> &'static str {
        "encke.Trace.1"
    }
}

//! The GPU of a build without GPU support: no value of these types exists.

use super::GpuError;

/// Declares a type without values, whose functions are never called, and functions that need a value to be called.
macro_rules! absent {
    ($name:ident { $(fn $method:ident($($parameter:tt)*) -> $result:ty;)* } $(fn $function:ident($($of:tt)*) -> $made:ty;)*) => {
        #[allow(missing_docs)]
        #[derive(Clone, Debug)]
        pub enum $name {}

        #[allow(missing_docs)]
        impl $name {
            $(pub fn $method($($parameter)*) -> $result { unreachable!("there is no GPU") })*
        }

        $(pub fn $function($($of)*) -> $made { unreachable!("there is no GPU") })*
    };
}
pub(crate) use absent;

absent! { Device {
    fn check(&self) -> Result<(), GpuError>;
} }
absent! { DevicePicture {} }
absent! { DeviceFrame {} }
absent! { SelfTest { fn fault(&self, _: &Device) -> Option<GpuError>; } }

impl Device {
    /// Never called.
    ///
    /// # Errors
    /// Never.
    pub fn find_fault<T, E>(&self, _: impl FnOnce() -> Result<Option<GpuError>, E>) -> Result<Option<GpuError>, E> {
        match *self {}
    }

    /// Always fails.
    ///
    /// # Errors
    /// Always.
    pub fn open(_: bool, _: Option<&str>) -> Result<Self, GpuError> {
        let wanted = "at all: this program was built without GPU support (feature `gpu`)".to_owned();
        Err(GpuError::NoAdapter { wanted, found: "none".to_owned() })
    }
}

/// Returns why there is no adapter.
pub fn list_adapters() -> Vec<String> {
    vec!["this program was built without it".to_owned()]
}

/// Does nothing.
pub fn begin_shutdown() {}

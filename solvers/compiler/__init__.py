"""The compiler: Numba, its private parts and the cache on disk, behind the names below.

kernel, inner_kernel    a function without the Python runtime; the second is called from kernels only
inlined                 a kernel whose text becomes part of its callers
local_kernel            a kernel that a function makes, not kept on disk
entry                   a kernel for given types, called by its address
parallel_kernel         a loop over the threads, with `prange`; `threads` sets their number
users_kernel            a function of the user; users_loop is a loop around one, users_callee a kernel that it calls
AddressCall             a call of a users_loop by its address, in kernels
optional, link          a kernel with a slot in a table of addresses, for features that few scenes have
record, Field, Table    NamedTuples of arrays that kernels take as one pointer
fingerprint             the content of a function, equal for those that compile to the same code
reduced                 how an object is pickled that holds functions
seconds, PAUSE          the clock of kernels
cache_folder            the folder of the compiled code
stamp                   a digest of the sources of all kernels
compiled                the kernels that this process compiled
compiled_signatures     the kernels compiled or loaded so far
shipped                 the code that came compiled with the package
CompilationError        Numba's error for code it cannot compile
"""

from solvers.compiler.addresses import AddressCall
from solvers.compiler.cache import cache_folder, shipped, stamp
from solvers.compiler.clock import PAUSE, seconds
from solvers.compiler.function_digest import fingerprint
from solvers.compiler.kernels import (
    CompilationError,
    compiled_signatures,
    entry,
    inlined,
    inner_kernel,
    kernel,
    local_kernel,
    reduced,
    users_callee,
    users_kernel,
    users_loop,
)
from solvers.compiler.optional import link, optional
from solvers.compiler.parallel import parallel_kernel, prange, threads
from solvers.compiler.progress import compiled
from solvers.compiler.records import Field, Part, Table, record, table

__all__ = [
    "PAUSE",
    "AddressCall",
    "CompilationError",
    "Field",
    "Part",
    "Table",
    "cache_folder",
    "compiled",
    "compiled_signatures",
    "entry",
    "fingerprint",
    "inlined",
    "inner_kernel",
    "kernel",
    "link",
    "local_kernel",
    "optional",
    "parallel_kernel",
    "prange",
    "record",
    "reduced",
    "seconds",
    "shipped",
    "stamp",
    "table",
    "threads",
    "users_callee",
    "users_kernel",
    "users_loop",
]

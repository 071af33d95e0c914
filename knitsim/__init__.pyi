# The public names as type checkers see them; at run time they are loaded on first use.
from knitsim.library.inference import calibrate as calibrate
from knitsim.library.inference import predict as predict
from knitsim.library.kes import kes as kes
from knitsim.library.rest import relax as relax
from knitsim.library.sweep import sweep as sweep
from knitsim.library.tests import Bend as Bend
from knitsim.library.tests import Biaxial as Biaxial
from knitsim.library.tests import Pull as Pull
from knitsim.library.tests import Shear as Shear
from knitsim.library.tests import bend as bend
from knitsim.library.tests import biaxial as biaxial
from knitsim.library.tests import pull as pull
from knitsim.library.tests import shear as shear
from knitsim.measured.read import read_measured as read_measured
from knitsim.store.reader import open_store as open_store
from knitsim.store.reader import scalar_table as scalar_table
from knitsim.study.study import Fabric as Fabric
from knitsim.study.study import Yarn as Yarn
from knitsim.study.study import load_study as load_study

__version__: str

-- the twenty stage runs that took longest
select round(wall_s, 3) as wall_s, round(cpu_s, 3) as cpu_s, stage, building, storey, scan,
       points_in, rows_in, rows_out, round(peak_memory_mb, 1) as peak_memory_mb, started_at, run
from stages
where outcome = 'computed'
order by stages.wall_s desc
limit 20
